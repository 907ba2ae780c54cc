"""When vehicles are on the scene, by hand."""

import pytest
import torch

from warp_torchrl.world.mechanics.arrivals.timetable import NEVER, Duties

DUTIES = Duties(stays=(8.0, 8.0, NEVER, NEVER), away=(4.0, NEVER, NEVER, NEVER), until=(NEVER, NEVER, NEVER, 30.0))
ARRIVES = torch.tensor([[2.0, 2.0, 5.0, 0.0]])


@pytest.mark.parametrize(
    ("now", "present", "until_there", "until_gone"),
    [
        (1.0, [0, 0, 0, 1], [1, 1, 4, 0], [0, 0, 0, 29]),
        (2.0, [1, 1, 0, 1], [0, 0, 3, 0], [8, 8, 0, 28]),
        (9.0, [1, 1, 1, 1], [0, 0, 0, 0], [1, 1, NEVER, 21]),
        (10.0, [0, 0, 1, 1], [4, NEVER, 0, 0], [0, 0, NEVER, 20]),
        (14.0, [1, 0, 1, 1], [0, NEVER, 0, 0], [8, 0, NEVER, 16]),
        (30.0, [1, 0, 1, 0], [0, NEVER, 0, NEVER], [4, 0, NEVER, 0]),
    ],
)
def test_vehicles_come_work_rest_and_go(now, present, until_there, until_gone):
    table = DUTIES.at(ARRIVES, torch.tensor([[now]]))
    assert table.present[0].tolist() == [bool(each) for each in present]
    assert table.until_there[0].tolist() == until_there and table.until_gone[0].tolist() == until_gone


def test_who_would_come_after_the_end_does_not():
    table = Duties((NEVER,), (NEVER,), (20.0,)).at(torch.tensor([[25.0]]), torch.tensor([[0.0]]))
    assert not table.present.any() and table.until_there.item() == NEVER
