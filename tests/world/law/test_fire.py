"""The fire's laws, against a literal loop and by hand on drawn maps."""

import math

import pytest
import torch
from scipy.stats import chi2
from torch import Tensor

from tests.world.drawing import draw, drawn, tiled
from tests.world.literal_fire import LiteralFire
from warp_torchrl.world.air.wind import Paper, Wind
from warp_torchrl.world.arrays.batch import concatenated
from warp_torchrl.world.arrays.random import Stream, uniform, world_key
from warp_torchrl.world.backends import backend
from warp_torchrl.world.backends.tick import in_wind
from warp_torchrl.world.law import law
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.law.law import growth_probability
from warp_torchrl.world.law.wind_and_slope import slope_factor
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import WorldState

ALMOST_ONE = 1.0 - 2.0**-24
CALM_WETLAND = {"ground": "www www www"}


def tick(fire: Fire, state: WorldState, u: float | Tensor | None = None) -> WorldState:
    """Advance all worlds by one tick, with the world's own draws or with given ones."""
    if u is None:
        u = uniform(state.key, state.tick, Stream.FIRE, tuple(state.cells.shape[1:]))
    elif isinstance(u, float):
        u = torch.full(state.cells.shape, u)
    return fire.tick(state, u, torch.ones_like(state.terminated))


def after_ticks(fire: Fire, state: WorldState, ticks: int, u: float | None = None) -> WorldState:
    for _ in range(ticks):
        state = tick(fire, state, u)
    return state


def chance(fire: Fire, state: WorldState) -> Tensor:
    return fire.spread_probability(state)


# One tick against the literal loop. All covers, every fire stage, ages on both sides of A_min, wet trees, a
# firebreak, fire in the corner, on the border and in the middle; a map that is not square.

CELLS = "a3TT1. TTbT~4 5#cTTT e2T9Td T1~Tb8"
GROUND = "ffgfgw wfgg~f gfwffg fwbwfg gf~gww"
METRES = [
    [0.0, 4.0, 9.0, 3.0, 0.0, 2.0],
    [6.0, 1.0, 5.0, 8.0, 7.0, 0.0],
    [2.0, 9.0, 3.0, 6.0, 1.0, 12.0],
    [8.0, 0.0, 5.0, 2.0, 4.0, 3.0],
    [1.0, 7.0, 0.0, 9.0, 11.0, 6.0],
]
WET = [[0, 0, 0, 4, 0, 0], [0] * 6, [0] * 6, [0, 0, 1, 0, 0, 0], [0] * 6]


def field_of_the_paper() -> Tensor:
    return Paper(scale=0.4)(world_key(torch.tensor([0]), torch.tensor([0])), (5, 6))[0]


LEVEL = [[0.0] * 6] * 5
PLAIN = {"alpha": Fire.alpha, "kernel": "alexandridis"}
"""What the paper has, for law hazard."""


def a_wind(name: str) -> Tensor:
    return {"uniform": torch.tensor([2.5, -1.5])[:, None, None], "field": field_of_the_paper()}[name]


VARIANTS = {
    "uniform wind": ("uniform", Fire(growth=True, beta=9.0, p_regrow=0.2)),
    "wind field, unit diagonal, five stages": (
        "field",
        Fire(growth=True, beta=9.0, p_regrow=0.2, burning_stages=5, diagonal="unit"),
    ),
    "two stages, younger trees": ("field", Fire(growth=True, beta=9.0, oldest=5, burning_stages=2)),
    "no growth, no lightning, no regrowth": ("field", Fire()),
    "four neighbours": ("uniform", Fire(growth=True, beta=9.0, neighbours=4)),
    "ellipse": ("field", Fire(growth=True, kernel="ellipse")),
    "hazard": ("uniform", HazardFire(growth=True, beta=9.0, p_regrow=0.2, refinement=8, **PLAIN)),
    "hazard, fbp": ("uniform", HazardFire(refinement=3, alpha=Fire.alpha)),
    "level": ("uniform", Fire(growth=True, beta=9.0, p_regrow=0.2)),
    "level, hazard": ("uniform", HazardFire(refinement=3, **PLAIN)),
    "level, four neighbours, unit diagonal": ("uniform", Fire(neighbours=4, diagonal="unit")),
    "hazard, ellipse, three ticks": (
        "field",
        HazardFire(kernel="ellipse", refinement=3, burning_stages=5, alpha=Fire.alpha),
    ),
    "fbp": ("field", Fire(growth=True, kernel="fbp")),
}
STAGE_AGE = [[2, 0, 0, 0, 0, 0], [0, 0, 0, 1, 0, 0], [0] * 6, [0] * 6, [0, 0, 0, 1, 0, 0]]


@pytest.fixture(params=VARIANTS)
def compared(request: pytest.FixtureRequest) -> tuple[Fire, WorldState, LiteralFire]:
    """Return an automaton, a drawn world and the literal loop of the same."""
    wind, fire = VARIANTS[request.param]
    metres = None if request.param.startswith("level") else METRES
    state = draw(CELLS, ground=GROUND, fire=fire, elevation=metres, wind=a_wind(wind))
    state = state.replace(wet=torch.tensor([WET], dtype=torch.uint8))
    if state.stage_age is not None:
        state = state.replace(stage_age=torch.tensor([STAGE_AGE], dtype=torch.uint8))
    u, v = a_wind(wind).expand(2, 5, 6).tolist()
    literal = LiteralFire(
        cells=state.cells[0].tolist(),
        cover=state.landscape.cover[0].tolist(),
        elevation=metres or LEVEL,
        wind=[[(u[row][column], v[row][column]) for column in range(6)] for row in range(5)],
        wet=WET,
        firebreak=state.firebreak[0].tolist(),
        growth=fire.growth,
        beta=fire.beta,
        p_regrow=fire.p_regrow,
        burning_stages=fire.burning_stages,
        oldest=fire.oldest,
        divide_by_distance=fire.diagonal == "distance",
        law="hazard" if isinstance(fire, HazardFire) else "paper",
        refinement=fire.ticks_per_stage,
        kernel=fire.kernel,
        slope_gain=fire.slope_gain,
        four_neighbours=fire.neighbours == 4,
        stage_age=STAGE_AGE,
    )
    return fire, state, literal


def test_the_chance_from_neighbours_is_the_literal_loop_s(compared: tuple[Fire, WorldState, LiteralFire]) -> None:
    fire, state, literal = compared
    wanted = [[literal.chance_from_neighbours(row, column) for column in range(6)] for row in range(5)]
    torch.testing.assert_close(chance(fire, state)[0], torch.tensor(wanted), atol=1e-6, rtol=0)
    assert sum(0.0 < q < 1.0 for row in wanted for q in row) >= 5


def test_the_expected_ignitions_are_the_literal_loop_s(compared: tuple[Fire, WorldState, LiteralFire]) -> None:
    fire, state, literal = compared
    wanted = [[literal.expected_to_ignite(row, column) for column in range(6)] for row in range(5)]
    wanted = torch.tensor(wanted) * ((state.cells[0] >= 11) & (state.cells[0] <= fire.last_spreading))
    torch.testing.assert_close(fire.expected_ignitions(state)[0], wanted, atol=1e-5, rtol=0)
    assert wanted.max() > 0.5


def test_the_risk_is_the_literal_loop_s(compared: tuple[Fire, WorldState, LiteralFire]) -> None:
    # Of a burning cell the neighbours that it should ignite, / 4 and at most 1; of a tree its chance to ignite.
    fire, state, literal = compared
    wanted = torch.zeros(5, 6)
    for row in range(5):
        for column in range(6):
            burning = literal.cells[row][column] >= 11
            expected = min(1.0, literal.expected_to_ignite(row, column) / 4.0)
            wanted[row, column] = expected if burning else literal.chance_to_ignite(row, column)
    torch.testing.assert_close(backend.forecast(fire, state).fire_risk()[0], wanted, atol=2e-6, rtol=0)


def counts_of_one_tick(fire: Fire, state: WorldState, trials: int) -> Tensor:
    """Return how often each cell had each code after one tick, int64 [H, W, 16]."""
    places = torch.arange(state.cells[0].numel()).view_as(state.cells[0]) * 16
    counts, batch = torch.zeros(16 * places.numel(), dtype=torch.int64), trials // 10
    many = state[torch.zeros(batch, dtype=torch.int64)]
    for first in range(0, trials, batch):
        seed = torch.arange(first, first + batch)
        after = tick(fire, many.replace(key=world_key(seed, torch.zeros_like(seed))))
        counts += torch.bincount((places + after.cells).flatten(), minlength=len(counts))
    return counts.view(*places.shape, 16)


def test_one_tick_is_distributed_as_the_literal_loop(compared: tuple[Fire, WorldState, LiteralFire]) -> None:
    # Pearson's chi-square over all cells and outcomes with 1e4 trials each; false alarm 1e-4 a variant. Outcomes
    # that never happen and those that always do are exact.
    fire, state, literal = compared
    trials = 10_000
    counts = counts_of_one_tick(fire, state, trials)
    statistic, freedom = 0.0, 0
    for row in range(5):
        for column in range(6):
            wanted = literal.outcomes(row, column)
            possible = {code: p * trials for code, p in wanted.items() if p > 0.0}
            seen = counts[row, column].tolist()
            assert sum(seen[code] for code in possible) == trials, (row, column)
            if min(possible.values()) >= 5.0:
                statistic += sum((seen[code] - mean) ** 2 / mean for code, mean in possible.items())
                freedom += len(possible) - 1
            else:
                assert all(abs(seen[code] - mean) < 30 for code, mean in possible.items())
    assert freedom >= 8
    assert chi2.sf(statistic, df=freedom) > 1e-4


def test_cells_ignite_independently() -> None:
    # Four trees round a fire in wetland: the number that ignite is binomial(4, 0.1), variance 0.36. The fourth
    # central moment is 0.36 (1 + 3 * 0.36 - 6 * 0.09 ...) < 0.6: standard error of the variance < sqrt(0.6 / 1e5)
    # = 0.0025; five of them, false alarm 6e-7.
    fire = Fire()
    state = draw(tiled(".T.. TaT. .T.. ....", 10, 10), ground=tiled("w", 40, 40), worlds=1000)
    crosses = (tick(fire, state).cells == 11).view(1000, 10, 4, 10, 4)
    lit = crosses.sum((2, 4)).double().flatten()
    assert lit.mean().item() == pytest.approx(0.4, abs=5 * 0.6 / math.sqrt(1e5))
    assert lit.var().item() == pytest.approx(0.36, abs=0.0125)


# Exact ends.


def test_a_chance_of_one_always_happens() -> None:
    # Grassland, 20 m/s: 1 * exp(0.9) = 2.46, clipped to 1.
    # 100 000 pairs of fire and tree, out of each other's reach.
    fire = Fire()
    state = draw(tiled("aT. ...", 25, 40), wind=(20.0, 0.0), worlds=100)
    assert (chance(fire, state)[:, ::2, 1::3] == 1.0).all()
    assert (tick(fire, state).cells[:, ::2, 1::3] == 11).all()


def test_a_chance_of_zero_never_happens() -> None:
    fire = Fire(alpha=(0.0, 0.0, 1.0, 0.8, 0.0))
    ground = tiled("gwg ggg", 25, 40)
    state = draw(tiled("aT. ...", 25, 40), ground=ground, fire=fire, wind=(20.0, 0.0), worlds=100)
    assert (chance(fire, state) == 0.0).all()
    assert (tick(fire, state).cells[:, ::2, 1::3] == 10).all()
    assert drawn(tick(fire, draw("aT", ground="gw", fire=fire), u=0.0)) == "bT"


def test_several_neighbours_of_chance_one_make_exactly_one() -> None:
    # q + p (1 - q) after odd chances in front of a certain one.
    fire = Fire()
    state = draw("aaa aTa aaa", wind=(0.3, 0.7))
    assert chance(fire, state)[0, 1, 1] == 1.0
    assert drawn(tick(fire, state, u=ALMOST_ONE)) == "bbb bab bbb"


def test_small_chances_are_not_lost() -> None:
    # Wetland against 60 m/s: 0.1 exp(0.045 * 60 - 2 * 0.131 * 60) = 0.1 exp(-13.02) = 2.2156e-7.
    state = draw("Ta.", ground="www", wind=(60.0, 0.0))
    assert chance(Fire(), state)[0, 0, 0].item() == pytest.approx(2.2156e-7, rel=1e-4)


@pytest.mark.parametrize(
    "fire, relief, wind",
    [
        pytest.param(Fire(slope_gain=1.0), 10_000.0, (0.0, 0.0), id="a cliff with the largest slope_gain"),
        pytest.param(Fire(wind_gain=1.0), 0.0, (120.0, 0.0), id="a gale with the largest wind_gain"),
    ],
)
def test_factors_too_large_for_a_float_make_a_chance_of_one_and_not_nan(
    fire: Fire, relief: float, wind: tuple[float, float]
) -> None:
    # exp(89.8) and exp(120) overflow float32 (3.4e38): 0 * inf is nan, and a nan chance never ignites.
    field = torch.tensor(wind)[:, None, None].expand(2, 1, 4).contiguous()
    metres = [[0.0, relief, relief, 2 * relief]]
    state = draw(".aTT", fire=fire, elevation=metres, wind=field)
    assert chance(fire, state).tolist() == [[[0.0, 0.0, 1.0, 0.0]]]


# Who burns, and for how long.


def test_a_burning_cell_runs_through_11_to_15_and_is_ash_then() -> None:
    fire, state = Fire(), draw("... .a. ...", age_on_fire=7)
    for picture in ("... .b. ...", "... .c. ...", "... .d. ...", "... .e. ..."):
        state = tick(fire, state)
        assert drawn(state) == picture
        assert state.age[0, 1, 1] == 7
        assert not state.burned.any()
    state = tick(fire, state)
    assert drawn(state) == "... ... ..."
    assert state.burned[0].tolist() == [[False] * 3, [False, True, False], [False] * 3]
    assert state.age[0, 1, 1] == 0
    assert state.tick.item() == 5


def test_an_ember_is_seen_and_does_not_spread() -> None:
    state = draw("TTT TeT TTT")
    assert (chance(Fire(), state) == 0.0).all()
    assert is_burning(state.cells)[0, 1, 1]
    assert drawn(tick(Fire(), state, u=0.0)) == "TTT T.T TTT"


def test_with_five_stages_the_last_spreads_too() -> None:
    fire = Fire(burning_stages=5)
    assert drawn(tick(fire, draw("TTT TeT TTT"), u=0.0)) == "aaa a.a aaa"


def test_trees_younger_than_two_do_not_burn() -> None:
    state = draw("111 2a. 33T")
    assert drawn(tick(Fire(), state, u=0.0)) == "111 ab. aaa"
    assert drawn(tick(Fire(youngest_fuel=4), state, u=0.0)) == "111 2b. 33a"


def test_a_tree_remembers_the_age_it_had_when_it_caught_fire() -> None:
    state = tick(Fire(growth=True), draw("4a9"), u=0.0)
    assert drawn(state) == "aba"
    assert state.age[0].tolist() == [[4, 10, 9]]


def test_nothing_burns_across_the_edges_of_the_map_or_into_the_next_world() -> None:
    # Two worlds in a row: fire at every border of the first, the second has none; the far columns stay dark.
    first, second = draw("a...T ..... T...a"), draw("TTTTT TTTTT TTTTT")
    both = concatenated([second, first, second])
    assert drawn(tick(Fire(), both, u=0.0), world=1) == "b...T ..... T...b"
    for world in (0, 2):
        assert drawn(tick(Fire(), both, u=0.0), world=world) == "TTTTT TTTTT TTTTT"


def test_a_world_that_is_not_due_stays_as_it_is() -> None:
    fire = Fire(growth=True, beta=100.0, p_regrow=1.0)
    state = draw(".eT 1aT", worlds=2)
    state = state.replace(wet=torch.full_like(state.wet, 3))
    after = fire.tick(state, torch.zeros(2, 2, 3), torch.tensor([False, True]))
    for name in ("cells", "age", "burned", "wet", "tick"):
        assert torch.equal(getattr(after, name)[0], getattr(state, name)[0]), name
    assert drawn(after, world=1) == "1.T 1bT"
    assert after.tick.tolist() == [0, 1]


# Wind and slope, by hand.


def test_a_diagonal_neighbour_is_reached_less_often() -> None:
    # Forest 0.8 / sqrt(2) = 0.565685.
    state = draw("TTT TaT TTT", ground="fff fff fff")
    corner, side = 0.565685, 0.8
    wanted = torch.tensor([[corner, side, corner], [side, 0.0, side], [corner, side, corner]])
    torch.testing.assert_close(chance(Fire(), state)[0], wanted)
    unit = torch.where(wanted > 0.0, 0.8, 0.0)
    alike = Fire(diagonal="unit")
    torch.testing.assert_close(chance(alike, draw("TTT TaT TTT", ground="fff fff fff", fire=alike))[0], unit)


# Wetland 0.1 and 10 m/s, theta 0, 45, 90, 135, 180 degrees off the wind:
#   0: 0.1 exp(0.45) = 0.156831                       90: 0.1 exp(0.45 - 1.31) = 0.042316
#  45: 0.1 exp(0.45 + 1.31 (0.707107 - 1)) / sqrt(2) = 0.075559
# 135: 0.1 exp(0.45 + 1.31 (-0.707107 - 1)) / sqrt(2) = 0.011849     180: 0.1 exp(0.45 - 2.62) = 0.011418
HEAD, QUARTER, FLANK, REAR_QUARTER, REAR = 0.156831, 0.075559, 0.042316, 0.011849, 0.011418
TO_THE_NORTH = [[QUARTER, HEAD, QUARTER], [FLANK, 0.0, FLANK], [REAR_QUARTER, REAR, REAR_QUARTER]]


@pytest.mark.parametrize(
    "wind, quarter_turns",
    [((0.0, 10.0), 0), ((-10.0, 0.0), 1), ((0.0, -10.0), 2), ((10.0, 0.0), 3)],
    ids=["to the north, smaller rows", "to the west", "to the south, larger rows", "to the east"],
)
@pytest.mark.parametrize("over_the_map", [False, True])
def test_the_fire_goes_where_the_air_goes(wind: tuple[float, float], quarter_turns: int, over_the_map: bool) -> None:
    field = torch.tensor(wind)[:, None, None].expand(2, 3, 3) if over_the_map else torch.tensor(wind)[:, None, None]
    state = draw("TTT TaT TTT", wind=field, **CALM_WETLAND)
    wanted = torch.tensor(TO_THE_NORTH).rot90(quarter_turns)
    torch.testing.assert_close(chance(Fire(), state)[0], wanted, atol=1e-6, rtol=0)


def test_the_wind_is_read_at_the_burning_cell() -> None:
    # Air moves east over the fire, and west over the trees.
    field = torch.zeros(2, 1, 3)
    field[0] = torch.tensor([-10.0, 10.0, -10.0])
    state = draw("TaT", ground="www", wind=field)
    torch.testing.assert_close(chance(Fire(), state)[0], torch.tensor([[REAR, 0.0, HEAD]]), atol=1e-6, rtol=0)


def test_a_stronger_wind_drives_the_head_faster() -> None:
    heads = [chance(Fire(), draw("aT", ground="ww", wind=(speed, 0.0)))[0, 0, 1].item() for speed in range(0, 40, 4)]
    assert heads == sorted(heads)
    assert heads[-1] > heads[0]


TEN_DEGREES = 30.0 * math.tan(math.radians(10.0))  # 5.2898 m to the next cell


def test_uphill_is_faster_and_downhill_slower() -> None:
    # exp(0.078 * 10) = 2.181472 and exp(-0.78) = 0.458406, times wetland 0.1.
    state = draw("TaT", ground="www", elevation=[[-TEN_DEGREES, 0.0, TEN_DEGREES]])
    torch.testing.assert_close(chance(Fire(), state)[0], torch.tensor([[0.0458406, 0.0, 0.2181472]]))


def test_the_slope_of_a_diagonal_is_over_its_own_distance() -> None:
    # 10 degrees over 42.43 m is 7.4809 m; 0.1 exp(0.78) / sqrt(2) = 0.154253.
    metres = [[0.0, math.sqrt(2.0) * TEN_DEGREES], [0.0, 0.0]]
    state = draw(".T a.", ground="ww ww", elevation=metres)
    assert chance(Fire(), state)[0, 0, 1].item() == pytest.approx(0.154253, abs=1e-6)


@pytest.mark.parametrize("metres", [[0.0, 0.0, 900.0], [900.0, 0.0, 0.0], [900.0, 0.0, 900.0]])
def test_only_the_slope_between_source_and_target_matters(metres: list[float]) -> None:
    # A wall beyond the target (or behind the source) changes nothing; calm and level, wetland 0.1.
    east = draw(".aT.", ground="wwww", elevation=[[metres[0], 0.0, metres[1], metres[2]]])
    assert chance(Fire(), east)[0, 0, 2].item() == pytest.approx(0.1, abs=1e-7)
    south = draw(". a T .", ground="w w w w", elevation=[[metres[0]], [0.0], [metres[1]], [metres[2]]])
    assert chance(Fire(), south)[0, 2, 0].item() == pytest.approx(0.1, abs=1e-7)


def test_the_cell_size_makes_the_slope() -> None:
    # 10 m over 10 m is 45 degrees: exp(0.078 * 45) = 33.448; direction 2 is east, into column 1 (row 0 is margin).
    factor = slope_factor(torch.tensor([[[0.0, 10.0], [0.0, 10.0]]]), 10.0, Fire().slope_gain)
    assert factor.shape == (1, 8, 4, 3)
    assert factor[0, 2, 1, 1].item() == pytest.approx(33.448, rel=1e-4)
    assert factor[0, 6, 1, 0].item() == pytest.approx(1 / 33.448, rel=1e-4)
    assert factor[0, 0, 1, 1].item() == 1.0


# Growth, lightning and regrowth.


def test_a_seedling_is_grown_after_226_ticks_and_after_38_where_it_grows_faster() -> None:
    # The sum of e^(s/2) for s = 1..9 is 226.24. With tau 2.5 that of e^(s/4) is 38.37, and the variances m^2 - m of
    # nine geometrics add up to 187.9, deviation 13.71. With 2048 trees a standard error is 0.30; five of them, false
    # alarm 6e-7.
    assert sum(1.0 / growth_probability(age, Fire().tau) for age in range(1, 10)) == pytest.approx(226.24, abs=0.01)
    fire = Fire(growth=True, tau=2.5)
    state = draw(tiled("1", 32, 64))
    ticks = torch.zeros(32, 64)
    while (state.cells < 10).any():
        ticks += state.cells[0] < 10
        state = tick(fire, state)
        assert state.tick.item() < 1000
    assert ticks.mean().item() == pytest.approx(38.37, abs=5 * 13.71 / math.sqrt(2048))


def test_a_tree_grows_with_the_topmost_draws() -> None:
    # p = exp(-age / 2): age 1 0.6065, age 9 0.0111; grown iff u >= 1 - p.
    fire = Fire(growth=True)
    assert drawn(tick(fire, draw("19T."), u=0.394)) == "29T."
    assert drawn(tick(fire, draw("19T."), u=0.393)) == "19T."
    assert drawn(tick(fire, draw("19T."), u=0.98895)) == "2TT."
    assert drawn(tick(fire, draw("19T."), u=0.98885)) == "29T."


def test_without_growth_nothing_grows() -> None:
    assert drawn(tick(Fire(), draw("123 89T"), u=ALMOST_ONE)) == "123 89T"


def test_a_tree_that_ignites_does_not_grow_and_one_that_must_ignite_never_does() -> None:
    fire = Fire(growth=True)
    assert drawn(tick(fire, draw("a5"), u=ALMOST_ONE)) == "ba"
    # Forest at p = 0.8: grown iff u >= 1 - 0.2 exp(-2.5) = 0.98358; between 0.8 and that nothing happens.
    for u, picture in ((0.7999, "ba"), (0.8001, "b5"), (0.9835, "b5"), (0.9837, "b6")):
        assert drawn(tick(fire, draw("a5", ground="ff"), u=u)) == picture


def test_lightning_by_hand() -> None:
    # 0.65 exp(10 - 10) / 6 = 0.108333 at age 10; 0.65 exp(-5) / 6 = 0.000730 at age 5; age 1 and lakes never.
    fire = Fire(beta=0.65)
    state = draw("T51 ~T.")
    assert drawn(tick(fire, state, u=0.1083)) == "a51 .a."
    assert drawn(tick(fire, state, u=0.1084)) == "T51 .T."
    assert drawn(tick(fire, state, u=0.000729)) == "aa1 .a."
    assert drawn(tick(fire, state, u=0.000731)) == "a51 .a."


def test_lightning_and_neighbours_join_as_independent_trials() -> None:
    # Forest, p_spread 0.8; p_spont 0.65 / 2 = 0.325: q = 0.325 + 0.675 * 0.8 = 0.865.
    fire = Fire(beta=0.65)
    state = draw("aT", ground="ff")
    assert drawn(tick(fire, state, u=0.8649)) == "ba"
    assert drawn(tick(fire, state, u=0.8651)) == "bT"


def test_tables_of_growth_and_lightning_are_made_once(monkeypatch: pytest.MonkeyPatch) -> None:
    fire, state, made = Fire(growth=True, tau=4.5, beta=3.5), draw("a55 555"), []
    for name in ("growth_probability", "lightning_probability"):
        rule = getattr(law, name)
        monkeypatch.setattr(law, name, lambda *given, rule=rule: made.append(rule) or rule(*given))
    backend.fastest(fire, state.cells.device).tick(state, torch.ones(1, dtype=torch.bool))
    assert len(made) == 2 * 16, "one of each cell code"
    after_ticks(fire, state, 3)
    assert len(made) == 2 * 16


def test_ash_and_bare_ground_regrow_but_not_firebreaks_lakes_or_rock() -> None:
    fire = Fire(p_regrow=0.25)
    state = draw("...# ~.e.", ground="gwfg ~bgb")
    assert drawn(tick(fire, state, u=0.2499)) == "111. ...."
    assert drawn(tick(fire, state, u=0.2501)) == ".... ...."
    assert drawn(after_ticks(fire, state, 2, u=0.0)) == "111. ..1."
    assert drawn(after_ticks(fire, state, 50, u=0.0)) == "111. ..1."


def test_ash_does_not_come_back_by_growth() -> None:
    assert drawn(after_ticks(Fire(growth=True), draw("..e"), 30, u=ALMOST_ONE)) == "..."


def test_a_wet_tree_cannot_ignite_for_as_many_ticks() -> None:
    # Lightning strikes every dry tree of age 10: min(1, 1e6 / 2) = 1.
    fire = Fire(beta=1e6)
    state = draw("TT")
    state = state.replace(wet=torch.tensor([[[10, 2]]], dtype=torch.uint8))
    pictures = [drawn(state := tick(fire, state)) for _ in range(11)]
    assert pictures[:3] == ["TT", "TT", "Ta"]
    assert [picture[0] for picture in pictures] == ["T"] * 10 + ["a"]


def test_a_fire_dies_for_good_only_without_lightning() -> None:
    assert Fire().burns_out
    assert not Fire(beta=0.65).burns_out


# Law hazard, by hand.


def test_a_hazard_by_hand() -> None:
    # Forest 0.8, k 8: h = -ln 0.2 / 8 = 0.201180; p = 1 - exp(-h) = 0.182235, and 1 - exp(-h / sqrt 2) = 0.132600.
    fire = HazardFire(alpha=Fire.alpha, refinement=8)
    state = draw("TTT TaT TTT", ground="fff fff fff", fire=fire)
    side, corner = 0.182235, 0.132600
    wanted = torch.tensor([[corner, side, corner], [side, 0.0, side], [corner, side, corner]])
    torch.testing.assert_close(chance(fire, state)[0], wanted, atol=1e-6, rtol=0)


def test_the_hazards_of_the_covers_keep_the_ratios_of_the_paper_s() -> None:
    # Wetland, grassland and forest: -ln 0.9, -ln 0.05 and -ln 0.2, over that of forest; alpha has two digits.
    hazards = [-math.log(1.0 - each) for each in HazardFire().alpha[1:4]]
    assert [each / hazards[2] for each in hazards] == pytest.approx([0.0655, 1.861, 1.0], rel=0.03)


def test_flammability_over_0_95_counts_as_0_95() -> None:
    # -ln 0.05 / 8 = 0.374467; 1 - exp(-0.374467) = 0.312344.
    fire = HazardFire(alpha=Fire.alpha, refinement=8)
    state = draw("aT", ground="gg", fire=fire)
    assert chance(fire, state)[0, 0, 1].item() == pytest.approx(0.312344, abs=1e-6)


@pytest.mark.parametrize("refinement", [1, 3, 8])
def test_what_a_fire_passes_on_in_its_life_does_not_depend_on_the_refinement(refinement: int) -> None:
    # Wetland 0.1 over four stages: 1 - 0.9^4 = 0.3439. 20 000 pairs; standard error 0.00336, five of them: 6e-7.
    fire = HazardFire(refinement=refinement, alpha=Fire.alpha)
    state = draw(tiled("aT. ...", 10, 20), ground=tiled("www www", 10, 20), fire=fire, worlds=100)
    state = after_ticks(fire, state, 4 * refinement)
    reached = state.cells[:, ::2, 1::3] != 10
    assert reached.float().mean().item() == pytest.approx(0.3439, abs=5 * 0.00336)
    assert torch.equal(state.cells[:, ::2, ::3], torch.full((100, 10, 20), 15, dtype=torch.uint8))


def test_every_stage_lasts_as_many_ticks_as_the_refinement() -> None:
    fire = HazardFire(refinement=3)
    state = draw("... .a. ...", fire=fire)
    seen = []
    for _ in range(16):
        seen.append(drawn(state)[5])
        state = tick(fire, state)
    assert "".join(seen) == "aaabbbcccdddeee."
    assert state.stage_age.max() == 0


def test_a_tree_put_out_and_lit_again_burns_its_whole_life() -> None:
    # Two ticks into its stage it is put out; when it is lit again the clock starts at nought.
    fire = HazardFire(refinement=3, beta=1e6)
    state = after_ticks(fire, draw("a.", fire=fire), 2)
    assert state.stage_age[0, 0, 0] == 2
    state = tick(fire, state.replace(cells=torch.tensor([[[10, 0]]], dtype=torch.uint8)), u=0.0)
    seen = []
    for _ in range(15):
        seen.append(drawn(state)[0])
        state = tick(fire, state, u=ALMOST_ONE)
    assert "".join(seen) == "aaabbbcccdddeee"


def test_a_world_that_is_not_due_keeps_its_stage() -> None:
    fire = HazardFire(refinement=2)
    state = tick(fire, draw("a.", fire=fire, worlds=2))
    after = fire.tick(state, torch.zeros(2, 1, 2), torch.tensor([False, True]))
    assert after.stage_age[:, 0, 0].tolist() == [1, 0]
    assert [drawn(after, world) for world in (0, 1)] == ["a.", "b."]


def test_a_tree_put_out_stays_wet_for_as_many_of_the_paper_s_ticks() -> None:
    assert Fire(wet_ticks=10).wet_for == 10
    assert HazardFire(wet_ticks=10, refinement=8).wet_for == 80


def test_growth_lightning_and_regrowth_keep_their_pace_in_finer_ticks() -> None:
    # p = 0.25 in a tick of the paper is 1 - 0.75^(1/2) = 0.133975 in half of one.
    fire = HazardFire(refinement=2, p_regrow=0.25)
    assert drawn(tick(fire, draw(".", fire=fire), u=0.1339)) == "1"
    assert drawn(tick(fire, draw(".", fire=fire), u=0.1340)) == "."


# Who is a neighbour.


def test_with_four_neighbours_no_fire_goes_across_a_corner() -> None:
    fire = Fire(neighbours=4)
    assert drawn(tick(fire, draw("TTT TaT TTT", fire=fire), u=0.0)) == "TaT aba TaT"


@pytest.mark.parametrize("wind", [Paper(), Paper(rotate=True)])
def test_a_chance_does_not_depend_on_the_batch(wind: Wind) -> None:
    fire = Fire(beta=0.65)
    state = draw(CELLS, ground=GROUND, fire=fire, elevation=METRES, worlds=65)
    calm = fire.ignition_probability(state)
    state = in_wind(state, fire, wind(state.key, (5, 6)))
    for probability in (fire.ignition_probability, lambda each: backend.forecast(fire, each).ignition_probability):
        q = probability(state)
        assert (q != calm).flatten(1).any(dim=1).all()
        for world in (0, 7, 64):
            assert torch.equal(q[world : world + 1], probability(state[world : world + 1]))
