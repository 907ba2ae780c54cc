"""Every figure of the docs is drawn, at sizes that take no time here, and measures what it prints."""

import math
import sys

import numpy as np
import pytest
import torch
from drawings.__main__ import FILMS, REAL_GROUND, WORLD, main
from drawings.landscapes import burn_probability, ignition
from drawings.laws import front
from drawings.measures import (
    diagonal_over_axis,
    fires_in_wind,
    fitted_exponent,
    length_over_breadth,
    point_fires,
    snapshots,
    strike_and_burn,
)
from PIL import Image

from tests.world.mechanics.there import needs
from warp_torchrl.commands.failure import DISK
from warp_torchrl.env.pictures.files import draw_figure
from warp_torchrl.world.air.wind import Calm
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.cells import is_tree
from warp_torchrl.world.state.state import OLDEST
from warp_torchrl.world.terrain.landscape import Perlin

SMALL = {
    "noise": {"size": 32},
    "noise_scales": {"size": 32, "scales": (20, 40)},
    "fire_plain": {"size": 24, "at": (4, 8)},
    "fire_terrain_wind": {"size": 24, "at": (4, 8)},
    "wind": {"size": 20, "ticks": 20},
    "embers": {"size": 24, "minutes": 20.0, "brands": 320},
    "hills": {"size": 24, "ridges": (20.0,)},
    "cover": {"size": 24},
    "isotropy": {"reach": 12, "worlds": 4},
    "ellipses": {"speeds": (0.0, 5.0), "reach": 12, "worlds": 6},
    "burned_by_wind": {"speeds": (0.0, 6.0), "ticks": 24, "worlds": 2},
    "house": {},
    "belief": {"times": (0, 1), "overrides": ("landscape.size=16", "belief.hidden=4")},
    "fire_sizes": {"size": 24, "trees_per_strike": 20, "fires": 60, "discard": 5},
}

BELIEVES = needs("belief", "radio", "sensing")


@pytest.fixture
def matplotlib():
    return pytest.importorskip("matplotlib", reason="figures are drawn with Matplotlib (extra figures)")


def is_drawn(path):
    """Whether a PNG shows something on white."""
    pixels = np.asarray(Image.open(path).convert("L"))
    return pixels.std() > 10.0 and (pixels == 255).mean() > 0.1


# Drawing


@pytest.mark.parametrize("name", [pytest.param(name, marks=BELIEVES if name == "belief" else ()) for name in WORLD])
def test_every_figure_is_drawn(name, tmp_path, matplotlib, monkeypatch):
    if name == "house":
        monkeypatch.setattr("drawings.house.PACKAGE", small_package(tmp_path / "small"))
    path = draw_figure(lambda: WORLD[name](**SMALL[name]), tmp_path / "new" / f"{name}.png")
    assert is_drawn(path)


def small_package(folder):
    """Make a package of three rooms with a world of two: that of the project has hundreds of files to read."""
    for room, text in {"top": "from small.world.law.fire import Fire", "world/law/fire": "", "world/air": ""}.items():
        (path := folder / f"{room}.py").parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"{text}\n" * 40)
    return folder


@pytest.mark.slow
def test_the_house_of_the_project_is_drawn(tmp_path, matplotlib):
    assert is_drawn(draw_figure(WORLD["house"], tmp_path / "house.png"))


@BELIEVES
@pytest.mark.parametrize("name", FILMS)
def test_every_animation_is_drawn_step_by_step(name, tmp_path):
    FILMS[name](path := tmp_path / f"{name}.webp", overrides=("landscape.size=16", "belief.hidden=4", "horizon=4"))
    film = Image.open(path)
    assert film.n_frames == 5 and np.asarray(film.convert("L")).std() > 10.0


@pytest.fixture
def rasters(tmp_path):
    """A folder of rasters: a plain of timber that climbs to the east, with a river."""
    pytest.importorskip("rasterio", reason="real ground is read with rasterio (extra gis)")
    from tests.world.rasters import write

    codes = np.full((30, 40), 8)
    codes[:, 30] = 98
    write(tmp_path / "ground_F13.tif", codes, dtype="int16")
    write(tmp_path / "ground_Elev.tif", np.arange(40.0) * np.ones((30, 1)))
    return tmp_path


def test_burn_probability_is_drawn_on_rasters(rasters, tmp_path, matplotlib):
    path = draw_figure(lambda: burn_probability(rasters, size=32, worlds=4, ticks=40), tmp_path / "burn.png")
    assert is_drawn(path)


def test_a_figure_has_the_same_pixels_each_time(tmp_path, matplotlib):
    matplotlib.rcParams["font.size"] = 20.0  # a user's own setting changes nothing
    try:
        second = draw_figure(lambda: WORLD["noise"](**SMALL["noise"]), tmp_path / "second.png")
    finally:
        matplotlib.rcdefaults()
    first = draw_figure(lambda: WORLD["noise"](**SMALL["noise"]), tmp_path / "first.png")
    assert first.read_bytes() == second.read_bytes()


# The command


def test_it_draws_what_it_is_asked_for(tmp_path, capsys, matplotlib):
    assert main(["cover", "--out", str(tmp_path)]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["cover.png"]
    (line,) = capsys.readouterr().out.splitlines()
    assert line.split()[0] == "cover" and " s " in line and str(tmp_path / "cover.png") in line


def test_it_lists_its_figures(capsys):
    assert main(["--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == [*WORLD, *FILMS, *REAL_GROUND, "episode"]
    assert all(len(line) > 40 for line in lines)


def test_without_rasters_it_says_why_burn_probability_is_not_drawn(tmp_path, capsys, matplotlib):
    assert main(["burn_probability", "--out", str(tmp_path)]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert "skipped" in line and "--landscape" in line
    assert not list(tmp_path.iterdir())


def one_line_of(capsys):
    captured = capsys.readouterr()
    (line,) = captured.err.splitlines()
    return line


@pytest.mark.parametrize(
    ("arguments", "said"),
    [(["clouds"], "got clouds"), (["--landscape", "nowhere"], "got nowhere")],
)
def test_a_mistake_is_told_in_one_line(arguments, said, capsys):
    assert main(arguments) == 2
    assert said in one_line_of(capsys)


def test_a_folder_without_rasters_is_a_mistake(tmp_path, capsys, matplotlib):
    assert main(["burn_probability", "--landscape", str(tmp_path), "--out", str(tmp_path)]) == 2
    assert "fuel" in one_line_of(capsys)


def test_a_file_in_the_place_of_the_folder_is_told_as_everywhere(tmp_path, capsys, matplotlib):
    (tmp_path / "file").touch()
    assert main(["noise", "--out", str(tmp_path / "file")]) == DISK
    assert one_line_of(capsys) == f"error: {tmp_path / 'file'}: File exists"


def test_without_matplotlib_it_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main(["noise"]) == 2
    assert 'pip install "warp_torchrl[figures]"' in one_line_of(capsys)


# What it measures


@pytest.mark.parametrize(("shape", "ratio"), [("square", math.sqrt(2.0)), ("circle", 1.0)])
def test_diagonal_over_axis_of_known_fronts(shape, ratio):
    place = torch.arange(-20.0, 21.0)
    down, across = place[:, None], place[None, :]
    arrival = torch.maximum(down.abs(), across.abs()) if shape == "square" else torch.hypot(down, across)
    assert diagonal_over_axis(arrival, 5, 15) == pytest.approx(ratio, rel=1e-5)


def test_a_certain_fire_s_front_is_a_square():
    arrival = front(Fire(diagonal="unit", alpha=(0.0, 0.0, 0.0, 1.0, 0.0)), reach=8, worlds=2)
    assert arrival.shape == (19, 19)
    assert diagonal_over_axis(arrival, 2, 6) == pytest.approx(math.sqrt(2.0))


def test_length_over_breadth_of_a_known_outline():
    # Half of the fires burn an ellipse of half axes 12 and 4 cells or more: probability 0.5 falls linearly through it.
    east, north = torch.arange(-20.0, 21.0)[None, :], torch.arange(-8.0, 9.0)[:, None]
    inside = 1.5 - torch.hypot(east / 12.0, north / 4.0)
    assert length_over_breadth(inside.clamp(0.0, 1.0)) == pytest.approx(3.0, rel=1e-3)


def test_wind_makes_a_fire_long():
    calm, windy = (fires_in_wind(speed, "ellipse", reach=12, worlds=6)[0] for speed in (0.0, 10.0))
    assert length_over_breadth(calm) == pytest.approx(1.0, abs=0.25)
    assert length_over_breadth(windy) > 2.0


def test_a_fire_that_the_wind_drives_away_is_refused():
    with pytest.raises(ValueError, match="reach"):
        fires_in_wind(-10.0, "ellipse", reach=8, worlds=2)


def test_fitted_exponent_finds_the_exponent_of_drawn_sizes():
    sizes = torch.arange(1, 1001).double()
    drawn = torch.multinomial(sizes**-1.15, 20_000, replacement=True) + 1
    exponent, error = fitted_exponent(drawn, 1, 1000)
    assert exponent == pytest.approx(1.15, abs=4 * error)
    assert 0.0 < error < 0.01


def test_strikes_burn_what_the_forest_grows():
    # In the steady state a fire takes what grows between two: theta x (1 - density).
    sizes, state = strike_and_burn(32, 40, 200, discard=60)
    density = is_tree(state.cells).float().mean().item()
    assert sizes.shape == (200,) and sizes.min() >= 1
    assert sizes.float().mean().item() == pytest.approx(40 * (1.0 - density), rel=0.25)


def test_snapshots_are_one_fire_in_time():
    ground = Perlin(size=16)(world_key(torch.tensor([3])))
    fire = Fire(growth=True, beta=50.0)
    early, late = snapshots(ground, fire, Calm(), (5, 9), 0, 30.0)
    (alone,) = snapshots(ground, fire, Calm(), (9,), 0, 30.0)
    assert int(early.tick) == 5
    assert torch.equal(late.cells, alone.cells) and not torch.equal(early.cells, late.cells)


def test_point_fires_start_from_a_patch_in_old_forest():
    history = point_fires(Fire(), (9, 11), (4, 3), ticks=0, worlds=2)
    assert (history.cells == OLDEST).sum() == 2 * (99 - 9)
    assert (history.arrival[:, 3:6, 2:5] == 0).all()


def test_the_ignition_is_the_nearest_fuel():
    cover = torch.zeros(9, 12, dtype=torch.uint8)
    cover[2, 4], cover[8, 11] = 3, 2
    assert ignition(cover) == (2, 4)
