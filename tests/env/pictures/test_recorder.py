"""Pictures of an episode: what a reader sees beside the map."""

import numpy as np
import pytest
import torch
from PIL import Image

from tests.env.pictures.worlds import drawn, small_world
from warp_torchrl.env.pictures.colours import HOUSE, LOST
from warp_torchrl.env.pictures.recorder import EpisodeRecorder
from warp_torchrl.env.pictures.render import render
from warp_torchrl.world.backends.tick import in_wind
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.state import WorldState


def test_a_saved_episode_can_be_read(tmp_path):
    team, state = small_world()
    recorder = EpisodeRecorder("single\nnoop", team.agent_roles)
    for step in range(5):
        recorder.add(state.replace(step=state.step + step))
    recorder.save(tmp_path / "episode.gif")
    with Image.open(tmp_path / "episode.gif") as film:
        assert (film.n_frames, film.size, film.info["loop"]) == (5, recorder.frame(state).size, 0)
        film.seek(4)
        assert film.info["duration"] == 2000
    assert [file.name for file in tmp_path.iterdir()] == ["episode.gif"]  # no partial file stays


def test_a_failed_save_leaves_the_old_file(tmp_path, monkeypatch):
    def full_disk(*_, **__):
        raise OSError("no space left on device")

    (tmp_path / "episode.gif").write_text("old")
    team, state = small_world()
    recorder = EpisodeRecorder("single", team.agent_roles)
    recorder.add(state)
    monkeypatch.setattr(Image.Image, "save", full_disk)
    with pytest.raises(OSError, match="no space"):
        recorder.save(tmp_path / "episode.gif")
    assert (tmp_path / "episode.gif").read_text() == "old"
    assert len([*tmp_path.iterdir()]) == 1


def test_an_episode_without_frames_is_refused(tmp_path):
    with pytest.raises(ValueError, match="at least one frame"):
        EpisodeRecorder("single", ["ugv"]).save(tmp_path / "episode.gif")


@pytest.mark.parametrize("steps", [1, 129, 130, 131, 132, 257, 260, 261, 262, 999])
def test_a_long_episode_keeps_an_even_sample_with_first_and_last(tmp_path, monkeypatch, steps):
    recorder = EpisodeRecorder("single", ["ugv"])
    monkeypatch.setattr(recorder, "frame", lambda index: Image.new("I", (1, 1), index))
    monkeypatch.setattr(Image.Image, "quantize", lambda image, **_: image)
    for index in range(steps):
        recorder.add(index)
    saved = {}
    monkeypatch.setattr(
        Image.Image, "save", lambda first, path, *_, **rest: saved.update(rest, first=first) or path.touch()
    )
    recorder.save(tmp_path / "episode.gif")
    kept = [image.getpixel((0, 0)) for image in (saved["first"], *saved["append_images"])]
    assert (kept[0], kept[-1]) == (0, steps - 1)
    assert min(steps, 65) <= len(kept) <= 130
    assert len(set(np.diff(kept[:-1]))) <= 1
    assert len(saved["duration"]) == len(kept)


@pytest.mark.parametrize(
    ("size", "expected"),
    [((32, 32), (384, 384)), ((8, 32), (96, 384)), ((256, 256), (512, 512)), ((40, 1200), (13, 384))],
)
def test_maps_of_any_size_fit_beside_the_panel(size, expected):
    frame = EpisodeRecorder("large", ["ugv"]).frame(drawn([[5] * size[1]] * size[0]))
    height, width = expected
    assert frame.size == (width + 216 + 3 * 12, max(height, 384) + 2 * 12)


def test_the_recorded_map_is_the_rendered_one():
    team, state = small_world((32, 32), worlds=2)
    frame = np.asarray(EpisodeRecorder("default", team.agent_roles).frame(state))
    assert np.array_equal(frame[12:396, 12:396], render(state, team.table(state.cells.device).index)[0].numpy())


def panel(state: WorldState, title="single", roles=("ugv",)) -> np.ndarray:
    """Return the panel at the right of a frame, without the margins."""
    return np.asarray(EpisodeRecorder(title, roles).frame(state))[12:-12, -228:-12]


def test_the_legend_shows_only_the_roles_that_take_part():
    violet, cyan = (124, 30, 190), (90, 236, 255)
    state = drawn([[5] * 4] * 4, at=((0, 0), (1, 1)))
    for roles, shown in (
        (("ugv", "ugv"), (True, False)),
        (("uav", "uav"), (False, True)),
        (("ugv", "uav"), (True, True)),
    ):
        picture = panel(state, roles=roles)[260:]
        assert tuple((picture == colour).all(-1).any() for colour in (violet, cyan)) == shown


@pytest.mark.parametrize("side", [32, 700])
def test_houses_are_on_the_map_and_in_the_legend_where_there_are_some(side):
    state = drawn([[5] * side] * side)
    left = torch.full((1, side, side), -1.0)
    left[0, 20, 20] = 1.0
    frames = [
        np.asarray(EpisodeRecorder("wui", ["ugv"], buildings).frame(state))
        for buildings in (lambda state: left, lambda state: None)
    ]
    shown, without = ((frame == HOUSE).all(-1) for frame in frames)
    assert shown[12:396, 12:396].any() and not without[12:396, 12:396].any()
    assert (frames[0][380:, -200:] == LOST).all(-1).any() and not (frames[1][380:, -200:] == LOST).all(-1).any()


@pytest.mark.parametrize("wind", [(4.0, 0.0), (-4.0, 0.0), (0.0, 4.0), (0.0, -4.0), (3.0, 3.0)])
def test_the_arrow_points_where_the_air_goes(wind):
    field = torch.tensor(wind).view(1, 2, 1, 1).expand(1, 2, 4, 4)
    dial = panel(in_wind(drawn([[5] * 4] * 4), Fire(), field))[190:237, 6:53].sum(-1) > 450  # inside the ring
    rows, columns = np.nonzero(dial)
    east, north = columns.mean() - 23, 23 - rows.mean()  # the head is the heavier end
    assert east * wind[0] + north * wind[1] > 4.0
    assert abs(east * wind[1] - north * wind[0]) < 4.0


def test_calm_air_has_no_arrow():
    dial = panel(drawn([[5] * 4] * 4))[190:236, 6:52]
    assert (dial == (24, 27, 32)).all(-1)[5:-5, 5:-5].all()


@pytest.mark.parametrize("title", ["", "\nnoop", "a scenario " * 20 + "\n" + "policy " * 40 + "\nmore"])
def test_any_title_stays_inside_the_panel(title):
    edge = np.asarray(EpisodeRecorder(title, ["ugv"]).frame(drawn([[5] * 4] * 4)))[:, -12:]
    assert (edge == (24, 27, 32)).all()
