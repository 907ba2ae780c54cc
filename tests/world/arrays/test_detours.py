"""Ways around lakes and fire on drawn maps."""

import pytest
import torch

from tests.world.arrays.test_geometry import marked
from warp_torchrl.system.device import unread
from warp_torchrl.world.arrays.detours import moves_around, moves_from
from warp_torchrl.world.arrays.distances import FAR


def counted(start: list[int], is_open: torch.Tensor) -> list[list[list[int]]]:
    """The moves to every cell, by a search of one agent after the other."""
    height, width = is_open.shape
    tables = []
    for begin in start:
        moves, edge = {begin: 0}, [begin]
        while edge:
            here = edge.pop(0)
            if here != begin and not is_open[here // width, here % width]:
                continue
            for row in range(here // width - 1, here // width + 2):
                for column in range(here % width - 1, here % width + 2):
                    there = row * width + column
                    if 0 <= row < height and 0 <= column < width and there not in moves:
                        moves[there] = moves[here] + 1
                        edge.append(there)
        tables.append([[moves.get(row * width + column, FAR) for column in range(width)] for row in range(height)])
    return tables


def everywhere(start: list[int], is_open: torch.Tensor) -> torch.Tensor:
    cells = torch.arange(is_open[0].numel()).expand(len(is_open), 1, -1)
    starts = torch.tensor(start).expand(len(is_open), -1)
    return moves_around(starts, is_open[:, None], cells).view(len(is_open), len(start), *is_open.shape[1:])


def test_ways_lead_around_what_is_closed_and_reach_its_edge() -> None:
    # x is open. From the north-west the wall's middle is two moves away, the cell behind it three by the south.
    is_open = marked("xx.xx xx.xx xxxxx")
    assert everywhere([0], is_open)[0, 0].tolist() == [[0, 1, 2, 4, 4], [1, 1, 2, 3, 4], [2, 2, 2, 3, 4]]
    assert everywhere([2], is_open)[0, 0].tolist() == [[2, 1, 0, 1, 2], [2, 1, 1, 1, 2], [2, 2, 2, 2, 2]]


def test_where_no_way_leads_is_far() -> None:
    is_open = marked("xx.. xx.. xx..")
    assert everywhere([0], is_open)[0, 0].tolist() == [[0, 1, 2, FAR], [1, 1, 2, FAR], [2, 2, 2, FAR]]


def test_a_way_of_more_moves_than_twice_both_sides_is_not_found() -> None:
    # One way there and back through rows of walls: 60 moves long, of which 2 (9 + 13) = 44 are found.
    rows = ["x" * 13, "." * 12 + "x", "x" * 13, "x" + "." * 12]
    is_open = marked(" ".join(rows[row % 4] for row in range(9)))
    moves = torch.tensor(counted([0], is_open[0])[0]).view(9, 13)
    assert int(moves[moves < FAR].max()) == 60
    found = everywhere([0], is_open)
    assert torch.equal(found[0, 0], torch.where(moves <= 44, moves, FAR))
    with unread():
        assert torch.equal(everywhere([0], is_open), found)


@pytest.mark.parametrize("agents", [1, 8, 9, 20])
def test_all_searches_at_once_find_what_one_after_the_other_finds(agents: int) -> None:
    generator = torch.Generator().manual_seed(agents)
    is_open = torch.rand(3, 9, 13, generator=generator) < torch.tensor([0.4, 0.7, 1.0])[:, None, None]
    start = torch.randint(117, (agents,), generator=generator).tolist()
    found = everywhere(start, is_open)
    assert found.tolist() == [counted(start, each) for each in is_open]
    with unread():
        assert torch.equal(everywhere(start, is_open), found)


def test_each_agent_has_its_own_ground_and_its_own_cells() -> None:
    wall, free = marked("x.x x.x"), marked("xxx xxx")
    moves = moves_around(torch.tensor([[0, 0]]), torch.stack((wall, free), 1), torch.tensor([[[2, 1], [2, 3]]]))
    assert moves.tolist() == [[[FAR, 1], [2, 1]]]


def test_the_moves_from_many_cells_are_those_from_the_nearest() -> None:
    is_open = marked("xx.xxxx xx.xxxx xx.xxxx")
    moves = moves_from(marked("x.....x ....... ......."), is_open, torch.tensor([[0, 1, 2, 3, 14, 20]]))
    assert moves.tolist() == [[0, 1, 2, 3, 2, 2]]
