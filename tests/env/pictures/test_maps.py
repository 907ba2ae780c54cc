"""The figure of maps: what is told apart by colour, what shows the ground, where the ignition is marked."""

import math

import numpy as np
import pytest
import torch
from PIL import Image

pytest.importorskip("matplotlib", reason="maps are drawn with Matplotlib (extra figures)")

from warp_torchrl.env.pictures.drawing import cover_image, hillshade, style
from warp_torchrl.env.pictures.maps import MapPanel, draw_maps, save_maps, without_holes
from warp_torchrl.world.state.state import Cover, Landscape


def ground(height=20, width=30, relief=False):
    cover = torch.full((1, height, width), int(Cover.FOREST), dtype=torch.uint8)
    cover[:, :, 0] = int(Cover.LAKE)
    elevation = torch.linspace(0.0, 90.0, width).expand(1, height, width).clone() if relief else None
    return Landscape(cover=cover, age=torch.ones_like(cover), elevation=elevation)


def images(panel, **options):
    """The map's colours as they are drawn, and its colour bar."""
    with style():
        figure = draw_maps(ground(), [panel], 100.0, "a title", **options)
    _, drawn = figure.axes[1].images
    return drawn


def test_a_chance_runs_from_0_to_1_and_shows_the_ground_where_it_is_none():
    values = torch.full((20, 30), 0.5)
    values[0, 0], values[0, 1] = 0.0, math.nan
    drawn = images(MapPanel(title="chance", values=values, label="probability"))
    assert drawn.get_clim() == (0.0, 1.0)
    assert drawn.get_array().mask.sum() == 2


def test_a_change_is_white_where_there_is_none_and_as_far_to_both_sides():
    values = np.zeros((20, 30))
    values[3, 4] = -0.4
    drawn = images(MapPanel(title="change", values=values, label="change", kind="change"))
    assert drawn.get_clim() == (-0.4, 0.4) and (~drawn.get_array().mask).sum() == 1


def test_an_amount_of_nothing_is_seen_and_one_beyond_the_top_has_an_arrow():
    values = torch.arange(600.0).view(20, 30)
    amount = MapPanel(title="hours", values=values, label="h", kind="amount")
    assert images(amount).get_clim() == (0.0, 599.0) and not images(amount).get_array().mask.any()
    assert images(amount).colorbar.extend == "neither"
    cut = images(MapPanel(title="hours", values=values, label="h", kind="amount", top=24.0))
    assert cut.get_clim() == (0.0, 24.0) and cut.colorbar.extend == "max"


@pytest.mark.parametrize("value", [0.0, math.nan])
def test_a_map_of_nothing_is_drawn(value, tmp_path):
    panel = MapPanel(title="change", values=torch.full((20, 30), value), label="change", kind="change")
    save_maps(tmp_path / "maps.png", ground(), [panel], 100.0, "nothing", torch.zeros(20, 30, dtype=torch.bool))
    assert Image.open(tmp_path / "maps.png").size[0] > 300


def test_one_small_patch_is_a_star_in_its_middle_and_a_large_one_an_outline():
    panel = MapPanel(title="chance", values=torch.ones(20, 30), label="probability")
    lit = torch.zeros(20, 30, dtype=torch.bool)
    lit[4:7, 9:12] = True  # 100 m cells: its middle is 1.05 km east, and 1.45 km north of the south
    with style():
        small = draw_maps(ground(), [panel], 100.0, "a title", lit).axes[1]
        lit[2:15, 2:20] = True
        large = draw_maps(ground(), [panel], 100.0, "a title", lit).axes[1]
    stars = [line for line in small.lines if line.get_marker() == "*"]
    assert np.allclose(stars[0].get_xydata(), [[1.05, 1.45]])
    assert not [line for line in large.lines if line.get_marker() == "*"]
    assert len(large.collections) == 1 and not small.collections


def test_holes_of_an_area_are_filled_and_its_bays_are_not():
    area = np.array([[cell == "#" for cell in row] for row in ("#####", "#...#", "#####", "#...#")])
    filled = without_holes(area)
    assert filled[1].all() and (filled[3] == area[3]).all(), "the last row is open to the south"


@pytest.mark.parametrize("count", [1, 2, 3, 4])  # with the ground: one row, two of two, one of three and two
def test_every_number_of_maps_finds_its_place(count, tmp_path):
    panels = [MapPanel(title=f"map {number}", values=torch.ones(20, 30), label="m") for number in range(count)]
    with style():
        figure = draw_maps(ground(relief=True), panels, 100.0, "a title")
    titles = [axes.get_title() for axes in figure.axes]
    assert [f"map {number}" in titles for number in range(count)] == [True] * count
    assert "land cover and relief, 0 to 90 m" in titles


def test_level_ground_has_the_colour_of_its_cover_and_a_slope_away_from_the_sun_is_darker():
    cover = ground().cover[0]
    plain, level = cover_image(cover), cover_image(cover, hillshade(torch.zeros(20, 30)))
    torch.testing.assert_close(level, plain, rtol=0.01, atol=0.01)
    falls_to_the_east = torch.linspace(900.0, 0.0, 30).expand(20, 30)
    assert (cover_image(cover, hillshade(falls_to_the_east)) < 0.95 * plain).all()
