"""Every rule that a component states for its fields: a bad value is a ValueError that names the field."""

import math
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from warp_torchrl.world.air.wind import Paper, Uniform, Wandering
from warp_torchrl.world.ignition.ignition import Ignition
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.array import Array
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import World

NAN, INF = math.nan, math.inf
FOREST = [[3] * 5] * 4

OUT_OF_RANGE = [
    (Fire, "tau", [-0.1, 100.1, NAN]),
    (Fire, "beta", [-0.1, 1.1e6, INF, NAN]),
    (Fire, "p_regrow", [-0.1, 1.1, NAN]),
    (Fire, "youngest_fuel", [0, 11, NAN]),
    (Fire, "oldest", [0, 1, 11, NAN]),  # 1 is younger than the youngest fuel
    (Fire, "burning_stages", [0, 6, NAN]),
    (Fire, "head_gain", [-0.1, 1.1, NAN]),
    (Fire, "ffmc", [49.9, 101.1, NAN]),
    (Fire, "neighbours", [0, 5, 9, NAN]),
    (Fire, "wind_gain", [-0.1, 1.1, NAN]),
    (Fire, "wind_focus", [-0.1, 1.1, NAN]),
    (Fire, "slope_gain", [-0.1, 1.1, NAN]),
    (Fire, "wet_ticks", [-1, 256, NAN]),
    (Fire, "alpha", [(0.0, 0.1, 1.0, 0.8), (0, 0, 0, 0, 0, 0), (0, 0.1, 1.1, 0.8, 0), (0, -0.1, 1, 1, 0), (NAN,) * 5]),
    (HazardFire, "refinement", [0, 65]),
    (HazardFire, "wet_ticks", [-1, 32]),  # 32 * 8 = 256
    (Ignition, "count", [0, 65]),
    (Ignition, "radius", [-1, 9]),
    (Ignition, "region", [0.0, -0.5, 1.1, NAN]),
    (Ignition, "head_start", [-1, 1001]),
    (Perlin, "size", [3, 4097, (3, 8), (8, 3), (8, 4097), 0, -8]),
    (Perlin, "scale", [0.9, 1.1e4, NAN, (0.9, 10.0), (20.0, 10.0), (10.0, NAN), (10.0,), (5.0, 10.0, 15.0), ()]),
    (Perlin, "octaves", [0, 13, (0, 4), (4, 3), (4, 13)]),
    (Perlin, "persistence", [-0.1, 1.1, NAN, (0.5, 1.1), (0.6, 0.5)]),
    (Perlin, "lacunarity", [0.9, 8.1, NAN, (2.0, 8.1), (3.0, 2.0), (1.0, 8.0)]),  # 8^5 / 15 is too fine
    (Perlin, "relief", [-1.0, 10_001.0, INF, NAN, (0.0, INF), (100.0, 0.0)]),
    (
        Perlin,
        "levels",
        [(0.1, 0.2), (0.1, 0.2, 0.3, 0.4), (-0.1, 0.2, 0.3), (0.1, 0.2, 1.1), (0.01, 0.2, 0.01), (NAN,) * 3],
    ),
    (Array, "size", [3, 4097, (3, 8)]),
    (Array, "min_fuel", [-0.1, 1.1, NAN]),
    (Array, "cell_size", [0.0, -30.0, 100_001.0, NAN]),
    (Array, "cover", [None, [3] * 16, [[5] * 5] * 4, [[-1] * 5] * 4, [[2.5] * 5] * 4, [[NAN] * 5] * 4]),
    (Team, "n_agents", [0, -1, 257]),
    (Team, "roles", [(), ("tank",), ("ugv", "boat"), "ugv"]),
    (Team, "extinguish_p", [-0.1, 1.1, NAN]),
    (Team, "tank", [-1, 10_001]),
    (Uniform, "speed", [-0.1, 60.1, NAN]),
    (Uniform, "direction", [NAN, INF]),
    (Paper, "scale", [-0.1, 10.1, NAN]),
    (Wandering, "speed", [-0.1, 60.1, NAN]),
    (Wandering, "direction", [NAN, INF]),
    (Wandering, "speed_deviation", [-0.1, 20.1, NAN]),
    (Wandering, "direction_deviation", [-0.1, 90.1, NAN]),
    (Wandering, "memory", [0.0, -1.0, 1.1e6, NAN]),
    (World, "steps_per_tick", [0, 1001]),
    (World, "horizon", [0, 1_000_001]),
    (World, "cell_size", [0.0, -30.0, 100_001.0, NAN]),
]

NO_SUCH_OPTION = [
    (Fire, "diagonal", ["units"]),
    (Fire, "kernel", ["circle"]),
    (Fire, "head_fuel", ["C-8"]),
    (Perlin, "frequency_law", ["texts"]),
    (Perlin, "thresholds", ["quantiles"]),
    (Perlin, "ages", ["old"]),
    (Array, "ages", ["old"]),
    (Team, "start", ["corners"]),
]

NOT_WHOLE = [
    (Fire, "youngest_fuel", [2.5]),
    (Fire, "oldest", [9.5]),
    (Fire, "burning_stages", [4.5]),
    (Fire, "wet_ticks", [2.5]),
    (HazardFire, "refinement", [2.5]),
    (Ignition, "count", [1.5]),
    (Ignition, "radius", [1.5]),
    (Ignition, "head_start", [1.5]),
    (Perlin, "octaves", [2.5, (2, 3.5)]),
    (Team, "n_agents", [2.5]),
    (Team, "tank", [2.5]),
    (World, "steps_per_tick", [2.5]),
    (World, "horizon", [9.5]),
]

MALFORMED = [(component, "size", [(8,), (8, 8, 8), 8.5, "8"]) for component in (Perlin, Array)]


def each(rules: list[tuple[type, str, list[Any]]]) -> list[Any]:
    return [
        pytest.param(component, field, value, id=f"{component.__name__}.{field}={value}")
        for component, field, values in rules
        for value in values
    ]


@pytest.mark.parametrize("component, field, value", each(OUT_OF_RANGE))
def test_a_value_out_of_range_is_an_error_that_names_its_field(component: type, field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=rf"\b{field}\b"):
        component(**{field: value})


@pytest.mark.parametrize("component, field, value", each(NO_SUCH_OPTION))
def test_an_unknown_option_is_an_error_that_names_its_field(component: type, field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=rf"\b{field}\b"):
        component(**{field: value})


@pytest.mark.parametrize("component, field, value", each(NOT_WHOLE))
def test_a_fraction_where_a_whole_number_is_due_is_an_error(component: type, field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=rf"\b{field}\b"):
        component(**{field: value})


@pytest.mark.parametrize("component, field, value", each(MALFORMED))
def test_a_size_that_is_no_size_is_an_error_that_names_it(component: type, field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=rf"\b{field}\b"):
        component(**{field: value})


def test_every_field_with_a_range_is_in_the_list() -> None:
    listed = {(component, field) for component, field, _ in OUT_OF_RANGE + NO_SUCH_OPTION}
    free = {
        (Fire, "growth"),
        (Perlin, "independent_elevation"),
        (Array, "path"),
        (Array, "elevation"),
        (Array, "age"),
        (Array, "assets"),
        (Array, "fuel"),
        (Array, "canopy_cover"),
        (Array, "canopy_height"),
        (Array, "canopy_base_height"),
        (Array, "canopy_bulk_density"),
        (Array, "row"),
        (Array, "column"),
        (Team, "allow_stay"),
        (Paper, "rotate"),
        *(
            (World, part)
            for part in (
                *("landscape", "wind", "fire", "team", "ignition", "sensing", "belief", "agencies", "mechanics"),
                *("action_masking", "goal"),  # a run knows the metrics: evaluation.goal
            )
        ),
    }
    for component in (
        Fire,
        Ignition,
        Perlin,
        Array,
        Team,
        Uniform,
        Paper,
        Wandering,
        World,
    ):
        for name in (field.name for field in fields(component) if field.init):
            assert (component, name) in listed | free, f"{component.__name__}.{name}"


@pytest.mark.parametrize(
    "field, value",
    [
        ("age", [[11] * 5] * 4),
        ("age", [[-1] * 5] * 4),
        ("age", [[2.5] * 5] * 4),
        ("age", [[3] * 4] * 4),
        ("elevation", [[NAN] * 5] * 4),
        ("assets", [[NAN] * 5] * 4),
        ("assets", [[-1.0] * 5] * 4),
        ("elevation", [[INF] * 5] * 4),
        ("elevation", [[1.0] * 4] * 4),
        ("elevation", np.zeros((1, 4, 5))),
        ("fuel", [[1.5] * 5] * 4),
        ("fuel", [[32768] * 5] * 4),
        ("fuel", [[101] * 4] * 4),
        ("canopy_cover", [[100.5] * 5] * 4),
        ("canopy_cover", [[NAN] * 5] * 4),
        ("canopy_height", [[-1.0] * 5] * 4),
        ("canopy_height", [[151.0] * 5] * 4),
        ("canopy_base_height", [[-0.1] * 5] * 4),
        ("canopy_bulk_density", [[12.0] * 5] * 4),
    ],
)
def test_a_bad_layer_of_an_array_is_an_error_that_names_it(field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=field):
        Array(cover=FOREST, **{field: value})


def test_an_array_smaller_than_a_map_is_an_error() -> None:
    with pytest.raises(ValueError, match="size"):
        Array(cover=[[3] * 3] * 3)


def test_a_noise_too_fine_for_memory_is_an_error() -> None:
    # 4^11 / 15 = 279 620 lattice steps a cell.
    with pytest.raises(ValueError, match="lacunarity"):
        Perlin(lacunarity=4.0, octaves=12)
    assert Perlin(lacunarity=4.0, octaves=12, frequency_law="printed").octaves == 12


def test_a_team_or_fires_too_many_for_the_map_are_an_error() -> None:
    # A quarter of 4 x 6 cells is 6.
    with pytest.raises(ValueError, match="n_agents"):
        World(landscape=Perlin(size=(4, 6)), team=Team(n_agents=7))
    with pytest.raises(ValueError, match="count"):
        World(landscape=Perlin(size=(4, 6)), ignition=Ignition(count=7))
    World(landscape=Perlin(size=(4, 6)), team=Team(n_agents=6), ignition=Ignition(count=6))


def test_the_ends_of_every_range_are_allowed() -> None:
    Fire(oldest=1, youngest_fuel=1, burning_stages=1)
    Fire(tau=0.0, beta=1e6, p_regrow=1.0, youngest_fuel=10, burning_stages=5, wet_ticks=255, alpha=(1.0,) * 5)
    Ignition(count=64, radius=8, region=1.0, head_start=1000)
    Perlin(
        size=(4, 4096), scale=1.0, octaves=1, persistence=1.0, lacunarity=1.0, relief=10_000.0, levels=(0.0, 0.0, 1.0)
    )
    Team(n_agents=256, extinguish_p=0.0, tank=1)
    Uniform(speed=60.0, direction=-1000.0)
    Paper(scale=0.0)


def test_levels_may_be_out_of_order_only_as_printed() -> None:
    assert Perlin(thresholds="printed", levels=(0.01, 0.2, 0.01)).levels == (0.01, 0.2, 0.01)
    with pytest.raises(ValueError, match="levels"):
        Perlin(thresholds="minmax", levels=(0.01, 0.2, 0.01))
