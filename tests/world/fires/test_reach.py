"""Where fire can go, by hand and by the plain rule."""

import torch

from tests.heuristics.drawing import scene
from warp_torchrl.world.arrays.geometry import grow
from warp_torchrl.world.fires.reach import distance_from_fire
from warp_torchrl.world.state.cells import is_tree


def ways(drawing: str) -> list[list[int]]:
    env, state = scene(drawing, at=[(0, 0)])
    return distance_from_fire(state, env.world)[0].tolist()


def test_fire_goes_around_a_line_and_through_the_cell_that_it_lacks() -> None:
    assert ways("TTTTT TT~~T Ta~TT TT~~T TTTTT") == [
        [2, 2, 2, 3, 4],
        [1, 1, 0, 0, 4],
        [1, 0, 0, 5, 5],
        [1, 1, 0, 0, 4],
        [2, 2, 2, 3, 4],
    ]
    assert ways("TTTTT TT~~T TaTTT TT~~T TTTTT")[2] == [1, 0, 1, 2, 3]


def test_fire_does_not_leave_a_closed_ring_nor_enter_young_trees() -> None:
    closed = ways("TTTTT T~~~T T~a~T T~~~T TTTTT")
    assert closed == [[0] * 5] * 5
    assert ways("T1Ta TTTT ~~~~ ~~~~")[0] == [3, 0, 1, 0]


def test_on_a_random_map_the_way_counts_the_rounds_of_growth() -> None:
    env, state = scene("T" * 20 + (" " + "T" * 20) * 19, at=[(0, 0)])
    random = torch.Generator().manual_seed(3)
    cells = torch.where(torch.rand(1, 20, 20, generator=random) < 0.6, 10, 0)
    cells[0, 7, 9] = 11
    state = state.replace(cells=cells.to(state.cells.dtype))
    reached, away = env.world.fire.spreads(state), torch.zeros(1, 20, 20, dtype=torch.int32)
    fuel = is_tree(state.cells) & (state.alpha > 0.0)
    for turn in range(1, 21):
        new = grow(reached) & fuel & ~reached
        away[new], reached = turn, reached | new
    assert away.max() > 10, "ways that wind"
    assert torch.equal(distance_from_fire(state, env.world), away)
