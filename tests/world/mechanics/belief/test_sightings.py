"""The cells that beliefs learn of in a step, as lists."""

import torch

from tests.world.drawing import codes
from warp_torchrl.world.mechanics.belief.sightings import sightings


def records(*steps, code=10):
    """Records of cells in a row of each world, seen at steps; -1 is never, and a tree on the map."""
    step = torch.tensor(steps, dtype=torch.int32)[:, None, None]
    return (1 + step) * 64 + torch.where(step < 0, 10, code)


def test_cells_are_listed_whose_records_are_newer_in_worlds_that_go_on():
    before = records([-1, 3, 4], [-1, -1, 4], [-1, -1, -1])
    after = records([-1, 5, 5], [-1, -1, 5], [5, 5, 5], code=12)
    tick = torch.full((3,), 64 * (1 + 4))  # the fire ticked at step 4
    seen = sightings(before, after, torch.tensor([True, True, False]), tick.to(torch.int32))
    assert seen.there[:, 0].tolist() == [[True, True], [True, False], [False, False]]
    assert seen.cell[:, 0].tolist() == [[1, 2], [2, 2], [0, 0]], "padding repeats the first cell"
    assert seen.first[:, 0].tolist() == [[True, False], [False, False], [False, False]]
    assert seen.burns[:2].all()


def test_what_is_put_stands_at_the_listed_cells_alone():
    before, after = records([-1, -1, -1], [-1, -1, -1]), records([-1, 5, 5], [5, -1, -1])
    seen = sightings(before, after, torch.tensor([True, True]), torch.zeros(2, dtype=torch.int32))
    assert seen.is_new[:, 0].tolist() == [[True, True], [True, True]], "padding writes what its first cell does"
    planes = codes("123", " 123").expand(2, 1, 2, 1, 3)
    assert seen.of(planes)[:, 0, 0].tolist() == [[2, 3], [1, 1]]
    put = seen.put(planes.contiguous(), torch.full((2, 1, 2, 2), 9))
    assert put[:, 0, 1, 0].tolist() == [[1, 9, 9], [9, 2, 3]]
    none = sightings(after, after, torch.tensor([True, True]), torch.zeros(2, dtype=torch.int32))
    assert not none.is_new.any()
