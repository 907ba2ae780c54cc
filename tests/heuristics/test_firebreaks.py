"""Firebreaks by hand, on grass in calm air."""

import pytest
import torch

from tests.heuristics.drawing import scene
from warp_torchrl.heuristics.firebreaks import cells_to_clear, pace_of_fire

MEADOW = "TTTTTTTTT " * 4 + "TTTTaTTTT" + " TTTTTTTTT" * 4


def square(distance: int) -> torch.Tensor:
    """The ring about the middle of the meadow."""
    away = (torch.arange(9) - 4).abs()
    return torch.maximum(away[:, None], away) == distance


def planned(env, state) -> torch.Tensor:
    return cells_to_clear(state, env.world, torch.tensor([True] * env.n_agents), effort=2.0)[0]


def test_the_pace_is_the_mean_chance_of_the_trees_beside_the_fire() -> None:
    env, state = scene(MEADOW, at=[(4, 3)])
    # Four at distance 1 ignite for certain, four at sqrt(2) with 1 / sqrt(2).
    assert pace_of_fire(state, env.world).tolist() == pytest.approx([(4 + 4 / 2**0.5) / 8])


@pytest.mark.parametrize(
    ("agents", "step", "distance"),
    [
        (4, 0, 1),  # 2 x 8 / 4 = 4 steps; fire comes after 5
        (3, 0, 2),  # 2 x 8 / 3 = 5.3, too late; 2 x 16 / 3 = 10.7, and fire comes after 5 (1 / 0.854 + 1) = 10.9
        (3, 1, 4),  # a step less is left: 0.3 too late at 3, and at 4 21.3 of 21.6
        (2, 0, 9),  # 2 x 8 d / 2 steps are too many for each: nothing is cleared
    ],
)
def test_the_ring_is_the_first_that_is_closed_in_time(agents: int, step: int, distance: int) -> None:
    env, state = scene(MEADOW, at=[(4, 3)] * agents)
    state = state.replace(step=torch.full_like(state.step, step))
    assert torch.equal(planned(env, state), square(distance))


def test_the_ring_of_a_tall_map_is_that_of_the_same_map_lying_down() -> None:
    rows = ["T" * 13, "a" + "T" * 12, "T" * 13, "T" * 13]
    wide, tall = (
        planned(*scene(" ".join(drawing), at=[place]))
        for drawing, place in ((rows, (1, 2)), (map("".join, zip(*rows, strict=True)), (2, 1)))
    )
    assert torch.equal(wide, tall.T) and wide.any(dim=1).all() and wide.any(dim=0).sum() == 1


def test_the_way_to_the_ring_takes_time() -> None:
    # Of four, one has 4 moves to the fire: 3 and 4 of 5 steps at 1, 2 and 8 of 10.9 at 2.
    env, state = scene(MEADOW, at=[(4, 3)] * 3 + [(0, 0)])
    assert torch.equal(planned(env, state), square(2))


def test_cells_that_take_longer_count_for_more() -> None:
    env, state = scene(MEADOW, at=[(4, 3)] * 4)
    effort, clears = torch.full(state.cells.shape, 2.0), torch.tensor([True] * 4)
    assert torch.equal(cells_to_clear(state, env.world, clears, effort)[0], square(1))
    effort[0, 3, 3] = 8.0  # 22 / 4 = 5.5 steps; fire comes after 5
    assert torch.equal(cells_to_clear(state, env.world, clears, effort)[0], square(2))


def test_a_later_state_goes_on_with_what_was_cleared() -> None:
    env, state = scene(MEADOW, at=[(4, 3)] * 3)
    done = square(2)
    done[:, 3:] = False  # five cells in the west; 2 x 11 / 3 = 7.3 steps for the others, of 8.9 that are left
    cells = state.cells.masked_fill(done, 0)
    after = state.replace(cells=cells, firebreak=state.firebreak | done, step=torch.full_like(state.step, 2))
    assert torch.equal(planned(env, after), square(2) & ~done)


def test_trees_too_young_to_burn_and_lakes_are_left() -> None:
    drawing = "TTTTTTT TT1~TTT TTTTTTT TTTaTTT TTTTTTT TTTTTTT TTTTTTT"
    env, state = scene(drawing, at=[(3, 2)] * 8)
    ring = planned(env, state)
    assert ring.sum() == 8 and not ring[1, 2:4].any()
    env, state = scene(drawing.replace("TT1~TTT TTTTTTT", "TTTTTTT TT1~TTT"), at=[(3, 2)] * 8)
    assert planned(env, state).sum() == 6
    env, state = scene(drawing.replace("TT1~TTT TTTTTTT", "TTTTTTT TT1~TTT"), at=[(3, 2)] * 8, growth=True)
    assert planned(env, state).sum() == 7, "it may grow until the fire comes"


def test_trees_on_ground_that_does_not_burn_are_left() -> None:
    env, state = scene(MEADOW, at=[(4, 3)] * 4)
    alpha = state.alpha.clone()
    alpha[0, 3, 3:6] = 0.0
    ring = planned(env, state.replace(ground=state.ground.replace(alpha=alpha)))
    assert ring.sum() == 5 and not ring[3].any()


def test_what_lies_behind_a_lake_needs_no_firebreak() -> None:
    # 2 x 5 and 2 x 9 steps of one agent are too late at 1 and 2; 2 x 6 at 3 are not, of 5 (2 / 0.88 + 1) = 16.3.
    env, state = scene("TTT~TTT TTT~TTT TTT~TTT TTa~TTT TTT~TTT TTT~TTT TTT~TTT", at=[(3, 1)])
    shut_in = torch.zeros(7, 7, dtype=torch.bool)
    shut_in[[0, 6], :3] = True
    assert torch.equal(planned(env, state), shut_in)


def test_who_does_not_clear_counts_neither_as_a_worker_nor_on_the_way() -> None:
    env, state = scene(MEADOW, at=[(4, 3)] * 4 + [(0, 0)] * 4)
    clears = torch.arange(8) < 4
    assert torch.equal(cells_to_clear(state, env.world, clears, effort=2.0)[0], square(1))
    assert torch.equal(cells_to_clear(state, env.world, clears.roll(1), effort=2.0)[0], square(2))


def test_nothing_is_cleared_about_a_fire_that_is_shut_in() -> None:
    env, state = scene("TTTTT T###T T#a#T T###T TTTTT", at=[(0, 0)])
    assert not planned(env, state).any()
