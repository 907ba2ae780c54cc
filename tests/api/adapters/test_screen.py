"""Pictures of the views: arrays, windows, and text on the terminal."""

import os
import sys
from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import render_test

from warp_torchrl.api.adapters import FireExtinguishingVectorEnv, gym_env, parallel_env, pettingzoo
from warp_torchrl.api.adapters.gymnasium import KEYS
from warp_torchrl.api.adapters.screen import PygameWindow, Terminal, as_text
from warp_torchrl.world.state.cells import is_burning


@pytest.fixture(params=["without pygame", "without a display", "with a display"])
def machine(request, monkeypatch):
    """Machines as pygame finds them: it draws into memory where it is told so, in a window of its own."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr("warp_torchrl.api.adapters.screen.FRAMES_PER_SECOND", 0)  # does not wait for people to look
    if request.param == "without pygame":
        monkeypatch.setattr("warp_torchrl.api.adapters.screen.find_spec", lambda name: None)
        yield Terminal
        return
    pygame = pytest.importorskip("pygame")
    if request.param == "with a display":
        monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    yield PygameWindow if request.param == "with a display" else Terminal
    pygame.display.quit()


def test_pettingzoo_finds_rendering_kept_on_every_machine(machine):
    render_test(lambda render_mode: pettingzoo.env("skirmish", render_mode=render_mode))
    assert isinstance(parallel_env("skirmish", render_mode="human")._screen._viewer, machine)


@pytest.mark.filterwarnings("error::UserWarning")
def test_gymnasium_finds_rendering_kept_without_a_display(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    check_env(gymnasium.make("Wildfire-v0", horizon=5).unwrapped)


def test_a_window_shows_what_an_array_holds_and_closes(monkeypatch):
    pygame = pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = parallel_env("skirmish", seed=0, render_mode="human")
    env.reset()
    env.step(dict.fromkeys(env.agents, 0))
    shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
    assert (shown == env._worlds.picture()).all() and pygame.display.get_caption()[0] == "skirmish (warp_torchrl)"
    env.close()
    assert not pygame.display.get_init()


@pytest.mark.filterwarnings("ignore:.*human:UserWarning")
def test_gymnasium_s_window_shows_one_agent(monkeypatch):
    pygame = pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = gymnasium.make("Wildfire-v0", render_mode="human")
    assert isinstance(env, gymnasium.wrappers.HumanRendering)
    env.reset(seed=0)
    shown = pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)
    assert (shown == env.env.render()).all()
    env.close()


def test_people_drive_to_the_fire_and_put_it_out_with_keys(monkeypatch):
    pygame = pytest.importorskip("pygame")
    from gymnasium.utils.play import play

    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = gymnasium.make("Wildfire-v0", render_mode="rgb_array")
    world, held, places = env.unwrapped._worlds.env, [], []

    def press(key):
        """Hold one key alone, or none."""
        for each in held:
            pygame.event.post(pygame.event.Event(pygame.KEYUP, key=ord(each)))
        held[:] = [key] if key else []
        for each in held:
            pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=ord(each)))

    def look(before, after, action, reward, terminated, truncated, info):
        state = world.world_state
        place = state.vehicles.position[0, 0]
        places.append(tuple(place.tolist()))
        if state.extinguished.any() or len(places) > 200:
            pygame.event.post(pygame.event.Event(pygame.QUIT))
            return
        fires = is_burning(state.cells[0]).nonzero()
        row, column = (fires[(fires - place).abs().amax(dim=1).argmin()] - place).sign().tolist()
        press({-1: "qwe", 0: "a d", 1: "zxc"}[row][column + 1])

    play(env, fps=1000, noop=KEYS["s"], callback=look, seed=1)
    assert world.world_state.extinguished.any() and len(set(places)) > 2


def test_keys_are_those_of_the_actions_that_there_are():
    keys = gym_env().get_keys_to_action()
    assert sorted(keys.values()) == list(range(11)) and keys[(ord("w"),)] == 0 and keys[(ord("s"),)] == 10
    assert sorted(gym_env(overrides=["team.allow_stay=false"]).get_keys_to_action().values()) == list(range(10))


def test_text_has_two_squares_to_a_character():
    frame = np.zeros((4, 6, 3), np.uint8)
    frame[0], frame[1, 3] = (255, 0, 0), (0, 7, 9)
    first, second = as_text(frame, columns=6, lines=2).split("\n")
    assert first.count("▀") == second.count("▀") == 6 and first.endswith("\x1b[0m")
    assert first.split("▀")[3] == "\x1b[38;2;255;0;0m\x1b[48;2;0;7;9m"
    assert as_text(frame, columns=3, lines=9) == as_text(frame, columns=9, lines=1)
    assert as_text(frame, columns=3, lines=9).startswith("\x1b[38;2;127;0;0m\x1b[48;2;0;0;0m▀")


@pytest.mark.parametrize("on_terminal", [True, False])
def test_pictures_on_a_terminal_fill_it_and_replace_each_other(monkeypatch, on_terminal):
    written = []
    out = SimpleNamespace(isatty=lambda: on_terminal, write=written.append, flush=lambda: None)
    monkeypatch.setattr("shutil.get_terminal_size", lambda: os.terminal_size((40, 24)))
    monkeypatch.setattr(sys, "stdout", out)
    Terminal().show(np.zeros((192, 192, 3), np.uint8))
    text = "".join(written)
    assert text.startswith("\x1b[H") == on_terminal
    assert len(text.strip("\n").split("\n")) == 19 and text.split("\n")[0].count("▀") == 38


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


def test_one_agent_has_no_window_of_its_own():
    with pytest.raises(ValueError, match="render_mode must be None or rgb_array, got 'human'"):
        gym_env(render_mode="human")
