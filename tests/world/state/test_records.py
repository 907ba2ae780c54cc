"""The records that agents keep of cells."""

import pytest
import torch

from tests.world.drawing import draw
from warp_torchrl.world.state.records import codes, freshness, kept, kinds, read, recorded, steps_since


def of_cells(*records):
    return torch.tensor([[records]], dtype=torch.int32)


def at_step(*steps):
    return torch.tensor(steps, dtype=torch.int32)


def test_a_record_tells_what_was_seen_and_when():
    kind = torch.tensor([[[[11, 16, 32 + 16, 4]]]], dtype=torch.uint8)  # a young fire, ash, ash in a firebreak, a tree
    record = recorded(kind, at_step(6))
    assert record.dtype == torch.int32
    assert record.flatten().tolist() == [7 * 64 + 11, 7 * 64 + 16, 7 * 64 + 48, 7 * 64 + 4]
    code, ash, firebreak = read(record)
    assert code.flatten().tolist() == codes(record).flatten().tolist() == [11, 0, 0, 4]
    assert ash.flatten().tolist() == [False, True, True, False]
    assert firebreak.flatten().tolist() == [False, False, True, False]


def test_records_age_and_what_was_never_seen_is_as_old_as_the_world():
    record = of_cells(64 * (1 + 9), 64 * (1 + 1) + 63, 63)  # seen in steps 9 and 1, and never
    assert steps_since(record, at_step(9)).flatten().tolist() == [0, 8, 10]
    assert freshness(record, at_step(9)).flatten().tolist() == [1.0, pytest.approx(16 / 24), 0.0]


def test_each_world_has_its_own_step():
    record = of_cells(64).expand(2, 1, 1)
    assert steps_since(record, at_step(0, 16)).flatten().tolist() == [0, 16]
    assert freshness(record, at_step(0, 16)).flatten().tolist() == [1.0, 0.5]


def test_kinds_of_cells():
    state = draw("TaT")
    state = state.replace(
        cells=state.cells * torch.tensor([[[1, 1, 0]]], dtype=torch.uint8),
        burned=torch.tensor([[[False, True, True]]]),  # what burned and stands again is no ash
        firebreak=torch.tensor([[[True, False, False]]]),
    )
    assert kinds(state).dtype == torch.uint8
    assert kinds(state).tolist() == [[[int(state.cells[0, 0, 0]) + 32, int(state.cells[0, 0, 1]), 16]]]


def test_who_sees_all_keeps_no_records():
    with pytest.raises(ValueError, match="sensing is full"):
        kept(draw("TaT"))
