"""Pictures and windows of the views."""

import numpy as np
import pytest
from pettingzoo.test import render_test

from warp_torchrl.adapters import FireExtinguishingVectorEnv, gym_env, parallel_env, pettingzoo

pytest.importorskip("matplotlib")
from matplotlib import pyplot
from matplotlib.backends.backend_agg import FigureCanvasAgg


@pytest.fixture
def display(monkeypatch):
    """Make matplotlib's canvas without a display pass for a window, and return how often it was drawn."""
    pyplot.switch_backend("agg")
    drawn = []
    monkeypatch.setattr(FigureCanvasAgg, "required_interactive_framework", "none of them", raising=False)
    monkeypatch.setattr(FigureCanvasAgg, "flush_events", lambda canvas: drawn.append(canvas))
    monkeypatch.setattr(pyplot.Figure, "show", lambda figure: None)
    return drawn


def test_pettingzoo_finds_rendering_kept(display):
    render_test(lambda render_mode: pettingzoo.env("skirmish", render_mode=render_mode))


def test_a_window_follows_resets_and_steps_and_closes(display):
    env = gym_env(render_mode="human")
    env.reset()
    env.step(0)
    assert len(display) == 2 and env.render() is None and len(display) == 3
    shown = env._screen._window._image.get_array()
    assert (shown == env._worlds.frames()[0]).all()
    env.close()
    assert not pyplot.get_fignums()


def test_without_a_display_the_window_is_refused_when_the_environment_is_made():
    pyplot.switch_backend("agg")
    with pytest.raises(RuntimeError, match="render_mode 'human' needs a display") as error:
        parallel_env("skirmish", render_mode="human")
    assert "\n" not in str(error.value) and not pyplot.get_fignums()


def test_without_matplotlib_the_window_is_refused_when_the_environment_is_made(monkeypatch):
    monkeypatch.setattr("warp_torchrl.adapters.screen.find_spec", lambda name: None)
    with pytest.raises(RuntimeError, match="needs matplotlib"):
        parallel_env("skirmish", render_mode="human")


def test_pictures_are_arrays():
    env = parallel_env("skirmish", render_mode="rgb_array")
    with pytest.raises(RuntimeError, match=r"call reset\(\) first"):
        env.render()
    env.reset()
    assert env.render().shape == (192, 192, 3) and env.render().dtype == np.uint8
    batch = FireExtinguishingVectorEnv(2, render_mode="rgb_array")
    batch.reset(seed=0)
    assert [frame.shape for frame in batch.render()] == [(192, 192, 3)] * 2


def test_rendering_without_a_mode_warns():
    env = gym_env()
    env.reset()
    with pytest.warns(UserWarning, match="render"):
        assert env.render() is None
