"""Pictures: what a reader sees of a cell, of an agent and of an episode."""

import numpy as np
import pytest
import torch
from PIL import Image

from tests.world.drawing import knowing
from warp_torchrl.env.pictures.render import EpisodeRecorder, render
from warp_torchrl.world.backends.tick import in_wind, initial_state
from warp_torchrl.world.ignition.ignition import Ignition
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.state import Cover, Landscape, WorldState
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import World

UGV, UAV = torch.tensor([0]), torch.tensor([1])


def small_world(size=(8, 8), n_agents=2, roles=("ugv", "uav"), worlds=1) -> tuple[Team, WorldState]:
    team = Team(n_agents=n_agents, roles=roles)
    world = World(landscape=Perlin(size=size), team=team, ignition=Ignition(count=1))
    seeds = torch.arange(worlds)
    return team, world.reset(seeds, torch.zeros_like(seeds))


def drawn(cells: list[list[int]], cover: Cover | list[list[int]] = Cover.FOREST, at=((0, 0),), **planes) -> WorldState:
    """Return one world from hand-written codes, with an agent at each place of ``at``."""
    codes = torch.tensor([cells], dtype=torch.uint8)
    ground = torch.full_like(codes, cover) if isinstance(cover, int) else torch.tensor([cover], dtype=torch.uint8)
    world, key = World(), torch.zeros(1, dtype=torch.int64)
    team = Team(n_agents=len(at)).place(key, ground, codes)
    landscape = Landscape(cover=ground, age=codes, elevation=None)
    state = initial_state(
        landscape, world.fire, torch.zeros(1, 2, 1, 1), key, team.replace(position=torch.tensor([at])), 30.0
    )
    return state.replace(**{name: torch.tensor([plane]).to(getattr(state, name)) for name, plane in planes.items()})


def colours(state: WorldState) -> torch.Tensor:
    """Return the colour of each cell of the first world, int64 [H, W, 3]."""
    return render(state, None, scale=1)[0].to(torch.int64)


def lightness(colour: torch.Tensor) -> torch.Tensor:
    """Return the luminance of sRGB colours, 0..1."""
    linear = (colour / 255.0) ** 2.2
    return linear @ torch.tensor([0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("size", [(8, 8), (5, 11), (13, 4)])
@pytest.mark.parametrize("scale", [1, 4, 12])
def test_a_frame_has_scale_pixels_to_a_cell(size, scale):
    team, state = small_world(size, worlds=3)
    frames = render(state, team.table(state.cells.device).index, scale)
    assert frames.shape == (3, size[0] * scale, size[1] * scale, 3)
    assert frames.dtype == torch.uint8


def test_a_batch_is_drawn_as_its_worlds_are():
    team, state = small_world(n_agents=5, worlds=4)
    roles = team.table(state.cells.device).index
    alone = torch.cat([render(state[index : index + 1], roles) for index in range(4)])
    assert torch.equal(render(state, roles), alone)


def test_a_scale_below_one_is_refused():
    with pytest.raises(ValueError, match="scale must be at least 1 pixel, got 0"):
        render(small_world()[1], None, scale=0)


def test_every_kind_of_cell_has_its_own_colour():
    ages = list(range(11))
    covers = [[cover] * 11 for cover in (Cover.WETLAND, Cover.GRASSLAND, Cover.FOREST)]
    trees = colours(drawn([ages] * 3, covers)).reshape(-1, 3)
    wet = colours(drawn([ages] * 3, covers, wet=[[3] * 11] * 3)).reshape(-1, 3)
    fire = colours(drawn([[11, 12, 13, 14, 15]]))[0]
    bare = colours(drawn([[0, 0]], [[Cover.LAKE, Cover.BARE]]))[0]
    ash_and_break = colours(drawn([[0, 0]], burned=[[True, False]], firebreak=[[False, True]]))[0]
    kinds = torch.cat((trees, wet, fire, bare, ash_and_break))
    assert len(kinds.unique(dim=0)) == len(kinds) == 33 + 33 + 5 + 2 + 2


def test_what_nobody_saw_lately_is_in_fog():
    state = drawn([[6, 12, 6, 12, 6]])
    plain = colours(state)[0]
    record = torch.tensor([[[[18, 1, 18, 1, 0]], [[1, 1, 1, 18, 0]]]], dtype=torch.int32) * 64
    state = knowing(state, record).replace(step=torch.full_like(state.step, 17))  # seen now, or 17 steps ago
    fog = colours(state)[0]
    assert [torch.equal(ours, theirs) for ours, theirs in zip(fog, plain)] == [True, False, True, True, False]
    assert (fog[1].int() < plain[1].int()).all() and (fog[4].int() < plain[4].int()).all()
    assert not torch.equal(fog[1], fog[4]), "fire is seen through it"
    earlier = colours(state.replace(step=torch.full_like(state.step, 16)))[0]
    assert torch.equal(earlier[1], plain[1]) and not torch.equal(earlier[4], plain[4])


def test_marks_are_drawn_where_they_are():
    # forest of age 6; burnt, cleared, wet and burning cells on the diagonal
    cells = [[0, 6, 6, 6], [6, 0, 6, 6], [6, 6, 6, 6], [6, 6, 6, 12]]
    mark = torch.eye(4, dtype=torch.bool)
    only = [
        torch.zeros(4, 4, dtype=torch.bool).index_put((torch.tensor(i), torch.tensor(i)), mark[i, i]) for i in range(3)
    ]
    image = colours(drawn(cells, burned=only[0].tolist(), firebreak=only[1].tolist(), wet=(only[2] * 4).tolist()))
    forest = image[0, 1]
    assert (image[~mark] == forest).all()
    ash, firebreak, wet, fire = image.diagonal(dim1=0, dim2=1).T
    assert ash.max() < 60  # dark
    assert ash.max() - ash.min() < 10  # and grey
    assert firebreak[0] > firebreak[1] > firebreak[2] > 128  # tan
    assert wet[2] > forest[2] + 50  # bluer
    assert fire[0] > 200 > fire[2] + 100  # red without blue


def test_a_tree_that_regrew_on_ash_looks_like_a_tree():
    assert torch.equal(colours(drawn([[4]], burned=[[True]])), colours(drawn([[4]])))


def test_fire_is_not_tinted_by_water():
    assert torch.equal(colours(drawn([[13]], wet=[[2]])), colours(drawn([[13]])))


def test_the_fire_front_is_lighter_than_any_ground():
    ages = list(range(11))
    ground = colours(drawn([ages] * 5, [[cover] * 11 for cover in Cover]))
    assert lightness(colours(drawn([[11, 12, 13]]))).min() > lightness(ground).max() * 1.15


def test_older_trees_are_darker_and_fire_dims_as_it_ages():
    trees = lightness(colours(drawn([list(range(11))]))[0])
    fire = lightness(colours(drawn([[11, 12, 13, 14, 15]]))[0])
    assert (trees.diff() < 0).all()
    assert (fire.diff() < 0).all()


@pytest.mark.parametrize(("roles", "body"), [(UGV, (124, 30, 190)), (UAV, (90, 236, 255))])
def test_an_agent_is_seen_in_its_cell(roles, body):
    state = drawn([[5] * 5] * 5, at=((1, 3),))
    changed = (render(state, roles, 10) != render(state, None, 10)).any(dim=-1)[0]
    assert render(state, roles, 10)[0, 15, 35].tolist() == list(body)
    assert changed[10:20, 30:40].float().mean() > 0.5
    rows, columns = changed.nonzero().unbind(1)  # and hides no neighbour's middle
    assert (rows.min() > 5, rows.max() < 25, columns.min() > 25, columns.max() < 45) == (True,) * 4


def test_agents_stay_visible_where_cells_are_small():
    state = drawn([[5] * 30] * 30, at=((15, 15),))
    assert (render(state, UGV, 1) != render(state, None, 1)).any(dim=-1).sum() > 40


@pytest.mark.parametrize("place", [(0, 0), (0, 4), (2, 0), (2, 4)])
@pytest.mark.parametrize("roles", [UGV, UAV])
def test_an_agent_in_a_corner_is_cut_at_the_edge(place, roles):
    state = drawn([[5] * 5] * 3, at=(place,))
    changed = (render(state, roles) != render(state, None)).any(dim=-1)[0]
    assert changed[12 * place[0] + 6, 12 * place[1] + 6]
    assert not changed[12 * (2 - place[0]) + 6, 12 * (4 - place[1]) + 6]  # nothing wraps round


def test_aircraft_are_drawn_over_ground_vehicles():
    state = drawn([[5] * 3] * 3, at=((1, 1), (1, 1)))
    for roles in (torch.tensor([0, 1]), torch.tensor([1, 0])):
        assert render(state, roles)[0, 18, 18].tolist() == [90, 236, 255]


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
