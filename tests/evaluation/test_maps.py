"""Maps of a policy: the ground is one, the fires are the same for both arms, and numbers add up."""

import numpy as np
import pytest
import torch

from tests.world.rasters import LANDFIRE, needs_landfire, rasterio
from warp_torchrl.evaluation import maps as maps_module
from warp_torchrl.evaluation.maps import maps_line, play_maps, write_maps
from warp_torchrl.evaluation.play import play
from warp_torchrl.heuristics import Coordinated, Dispatch, NoOp
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.world.terrain.fixed import Fixed

TINY = ["landscape.size=12", "horizon=24", "evaluation.first_seed=2000000"]


def plan_of(*overrides):
    return run_config(plain(compose_config("train", [*TINY, *overrides])))


@pytest.fixture(scope="module")
def maps():
    return play_maps(plan_of(), Coordinated, "sampled", 24)


def test_a_team_that_does_nothing_changes_nothing():
    maps = play_maps(plan_of(), NoOp, "sampled", 6)
    assert (maps.area_with == maps.area_without).all() and (maps.cleared == 0.0).all()
    assert (maps.difference.nan_to_num() == 0.0).all()


def test_a_team_protects_the_ground_that_burns_without_it(maps):
    numbers = maps.numbers()
    assert numbers["burned_ha"]["difference"]["ci95"][1] < 0.0
    assert maps.difference.nanmean() < -0.1
    assert numbers["fires"] == 24 and numbers["ground_seed"] == 2_000_000 and numbers["horizon"] == 24


def test_areas_are_the_sums_of_the_maps(maps):
    # Cells of 30 m: the mean area is the sum of the probabilities x 0.09 ha.
    assert maps.area_without.mean() == pytest.approx(0.09 * float(maps.without.nansum()), rel=1e-5)
    assert maps.area_with.mean() == pytest.approx(0.09 * float(maps.with_team.nansum()), rel=1e-5)
    difference = maps.numbers()["burned_ha"]["difference"]["mean"]
    assert difference == pytest.approx(0.09 * float(maps.difference.nansum()), rel=1e-4)


def test_the_maps_count_what_the_metrics_count(maps):
    # The same worlds by hand: burned and burning are shares of the initial trees, which are those of one ground.
    plan = plan_of()
    landscape = Fixed(source=plan.world.landscape, seed=2_000_000)
    env = maps_module.replace(plan, world=maps_module.replace(plan.world, landscape=landscape)).make_env(24, 2_000_000)
    for policy, area in ((NoOp(env), maps.area_without), (Coordinated(env), maps.area_with)):
        episodes = play(env, policy, 2_000_000)
        trees = int((~maps.without.isnan()).sum())
        assert area == pytest.approx(0.09 * trees * (episodes["burned"] + episodes["burning"]), rel=1e-5)


def test_what_a_team_clears_is_counted_as_the_metrics_count_it():
    plan = plan_of("team.tank=0")
    maps = play_maps(plan, Dispatch, "sampled", 4)
    landscape = Fixed(source=plan.world.landscape, seed=2_000_000)
    env = maps_module.replace(plan, world=maps_module.replace(plan.world, landscape=landscape)).make_env(4, 2_000_000)
    cleared = play(env, Dispatch(env), 2_000_000)["cleared"]
    trees = int((~maps.without.isnan()).sum())
    assert maps.cleared == pytest.approx(0.09 * trees * cleared, rel=1e-5) and maps.cleared.max() > 0.0
    assert maps.numbers()["cleared_ha"]["mean"] == pytest.approx(maps.cleared.mean())


def test_only_cells_that_had_a_tree_have_a_probability(maps):
    had = (maps.ground.age[0] > 0) | maps.lit
    assert (maps.without.isnan() == ~had).all() and (maps.with_team.isnan() == ~had).all()
    assert maps.lit.any() and (maps.without[maps.lit] > 0.0).all(), "where a fire starts something burns"


def test_fires_in_several_batches_are_the_same_fires(maps, monkeypatch):
    monkeypatch.setattr(maps_module, "_MOST_WORLDS", 7)
    parts = play_maps(plan_of(), Coordinated, "sampled", 24)
    assert (parts.area_with == maps.area_with).all() and (parts.area_without == maps.area_without).all()
    assert torch.equal(parts.with_team.nan_to_num(-1.0), maps.with_team.nan_to_num(-1.0))
    assert torch.equal(parts.lit, maps.lit)


def test_maps_of_made_up_ground_are_in_metres_without_a_crs(maps, tmp_path, blank_figures):
    write_maps(tmp_path, maps, None, "a title", "coordinated")
    names = [f"burn_probability_{name}.tif" for name in ("difference", "with", "without")]
    assert sorted(path.name for path in tmp_path.iterdir()) == [*names, "maps.png"]
    with rasterio.open(tmp_path / "burn_probability_difference.tif") as file:
        assert file.crs is None and file.bounds == (0.0, 0.0, 360.0, 360.0)
        assert np.array_equal(file.read(1), maps.difference.numpy(), equal_nan=True)


@needs_landfire
def test_maps_of_real_ground_lie_where_the_window_does(tmp_path, blank_figures):
    plan = plan_of("landscape=raster", f"landscape.path={LANDFIRE}", "landscape.size=16", "horizon=6")
    maps = play_maps(plan, NoOp, "sampled", 2)
    write_maps(tmp_path, maps, plan.world.landscape.grid, "a title", "coordinated")
    row, column = maps.ground.corner[0].tolist()
    with rasterio.open(LANDFIRE / "LC22_F13_230.tif") as fuel:
        crs, west, north = fuel.crs, fuel.bounds.left, fuel.bounds.top
    with rasterio.open(tmp_path / "burn_probability_with.tif") as file:
        assert file.crs == crs and file.shape == (16, 16) and (row, column) != (0, 0)
        assert (file.bounds.left, file.bounds.top) == (west + 30.0 * column, north - 30.0 * row)


def test_the_line_of_the_maps_has_the_paired_interval(maps):
    low, high = maps.numbers()["burned_ha"]["difference"]["ci95"]
    assert f"({low:+.2f} .. {high:+.2f})" in maps_line(maps.numbers())
