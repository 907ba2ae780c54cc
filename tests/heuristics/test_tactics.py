"""The tactics of initial attack on fires drawn by hand, and what they read of the wind."""

from dataclasses import dataclass

import pytest
import torch

from tests.heuristics.drawing import chosen, scene
from tests.world.drawing import draw
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.heuristics.tactics import along_axis
from warp_torchrl.world.arrays.batch import Batch


@dataclass(eq=False, repr=False)
class Told(Batch):
    """What a mechanic of values tells."""

    worth: torch.Tensor


LONG = "TTTTTTTTTTTTT TTTTTTTTTTTTT TTTTTaaaTTTTT TTTTTTTTTTTTT TTTTTTTTTTTTT"
"""A fire of three cells whose middle is in row 2, column 6."""


@pytest.mark.parametrize(
    ("wind", "rear", "head", "right"),
    [
        ((5.0, 0.0), (2, 5), (2, 7), (4, 6)),  # to the east: south is on the right
        ((-5.0, 0.0), (2, 7), (2, 5), (0, 6)),
        ((0.0, 0.0), (2, 5), (2, 7), (4, 6)),  # calm: as if to the east
    ],
)
def test_the_axis_is_the_wind_s(wind, rear, head, right):
    along, across = along_axis(draw(LONG, wind=wind))
    assert along[0][rear] == 0.0 and along[0][head] == 1.0 and along[0][2, 6] == 0.5
    assert across[0][right] == 2.0 and across[0][2, 6] == 0.0


def test_in_a_wind_to_the_north_the_east_is_on_the_right():
    along, across = along_axis(draw("TTT TaT TaT TTT", wind=(0.0, 4.0)))
    assert along[0][2, 1] == 0.0 and along[0][1, 1] == 1.0
    assert across[0, 1].tolist() == [-1.0, 0.0, 1.0]


def test_a_fire_of_one_cell_has_an_axis_and_no_fire_an_action():
    along, across = along_axis(draw("TTT TaT TTT", wind=(3.0, 0.0)))
    assert along[0, 1].tolist() == [-1.0, 0.0, 1.0] and across[0, :, 1].tolist() == [-1.0, 0.0, 1.0]
    env, state = scene("TTTT TTTT TTTT TTTT", at=[(1, 1)])
    assert len(chosen(env, state, "flank_attack")) == 1


def test_an_attack_at_the_head_passes_by_nearer_fire():
    env, state = scene("TTTTTTTTTTTTT TTTaTTTTTaTTT TTTTTTTTTTTTT TTTTTTTTTTTTT", at=[(0, 5)])
    assert chosen(env, state, "dispatch")[0].endswith("WEST")
    assert chosen(env, state, "head_attack")[0].endswith("EAST")
    assert chosen(env, state, "flank_attack")[0].endswith("WEST")


def test_a_flank_attack_divides_the_flanks_and_begins_at_the_rear():
    env, state = scene("TTTTTTTTTT TTTaaaaaTT TTTaaaaaTT TTTaaaaaTT TTTTTTTTTT", at=[(2, 0), (2, 0)])
    policy = HEURISTICS["flank_attack"](env)
    value, edge = policy.value(state)
    cells = edge.flatten(1).nonzero()[:, 1][None]
    best = cells[0, policy.worth(state, value, cells)[0].argmax(dim=1)].tolist()
    assert [divmod(cell, 10) for cell in best] in ([(1, 3), (3, 3)], [(2, 3), (3, 3)]), "left in the north, then right"


def test_a_line_is_built_from_the_rear_a_cell_away_from_the_fire():
    fire = "TTTTTTTTT TTTTTTTTT TTTTTTTTT TTTTaTTTT TTTTTTTTT TTTTTTTTT TTTTTTTTT"
    env, state = scene(fire, at=[(3, 2)])
    assert chosen(env, state, "anchor_and_flank") == ["CLEAR"], "two cells behind the fire"
    env, state = scene(fire, at=[(3, 0)])
    assert chosen(env, state, "anchor_and_flank")[0].endswith("EAST")
    env, state = scene(fire, at=[(3, 3)])
    assert chosen(env, state, "anchor_and_flank") == ["EXTINGUISH"], "what is in reach"


def test_a_point_is_protected_before_nearer_fire():
    env, state = scene(f"{'T' * 25} TTTTaTTTTTTTTTTTTTTaTTTTT {'T' * 25} {'T' * 25}", at=[(0, 9)])
    assets = torch.zeros_like(state.alpha)
    assets[0, 1, 22] = 5.0  # three cells from the fire in the east, which is farther
    landscape = state.landscape.with_layers(assets=assets)
    with_assets = state.replace(ground=state.ground.replace(landscape=landscape))
    assert chosen(env, state, "point_protection")[0].endswith("WEST"), "without assets it is dispatch"
    assert chosen(env, with_assets, "point_protection")[0].endswith("EAST")
    assert chosen(env, state.with_planes("values", Told(assets)), "point_protection")[0].endswith("EAST")
