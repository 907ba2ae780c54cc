"""Dispatch where work takes time, flames may be too long, and houses are worth something."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import torch

from tests.heuristics.drawing import scene as drawn_scene
from tests.world.mechanics.there import needs
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.state.state import Action


@dataclass(eq=False, repr=False)
class Told(Batch):
    """What a mechanic of values tells."""

    worth: torch.Tensor


GRASS = " ".join(["gggggggg"] * 4)


def acts(state, world, name="dispatch"):
    policy = HEURISTICS[name](SimpleNamespace(world=world, shared_state=state))
    return [Action(each).name for each in policy.choose(state, world.possible_actions(state))[0].tolist()]


def working(*at, drawing="TTTTTTTT aTTTTTTT TTTTTTTT TTTTTTTa", **given):
    from tests.world.mechanics.lines.test_lines import scene
    from warp_torchrl.world.mechanics.lines.lines import FireLines

    return scene(FireLines(**given), *at, drawing=drawing, ground=GRASS)


@needs("lines")
def test_agents_work_at_one_fire_together():
    state, world = working((0, 1), (1, 1), water=4.0)
    assert acts(state, world) == ["EXTINGUISH", "EXTINGUISH"]
    alone = replace(world, mechanics=())
    assert acts(state.without_planes("lines"), alone)[0] == "EXTINGUISH"
    assert acts(state.without_planes("lines"), alone)[1] != "EXTINGUISH", "without work the second goes on"


@needs("lines")
def test_a_line_is_built_where_it_is_sooner_done_than_half_of_putting_out():
    # Grass: 86 chains an hour, 28.9 m a minute, 21 steps; flames of 1 m: 100 steps over the water.
    assert acts(*working((1, 1))) == ["CLEAR"]
    assert acts(*working((1, 1), water=4.0)) == ["EXTINGUISH"], "25 steps"
    assert acts(*working((1, 1), water=0.5, gain=0.05)) != ["CLEAR"], "430 steps, and 200"


@needs("lines")
def test_who_cannot_work_at_the_flames_builds_line_beside_them():
    state, world = working((1, 1), flame_length=3.0)
    assert not world.possible_actions(state)[0, 0, int(Action.EXTINGUISH)]
    assert acts(*working((3, 5), flame_length=3.0))[0] in ("EAST", "NORTH_EAST", "SOUTH_EAST"), "it comes near"


def test_where_worth_is_the_goal_the_fire_before_the_house_comes_first():
    env, state = drawn_scene("TTTTTTTTTTTTT TTTaTTTTTTaTT TTTTTTTTTTTTT TTTTTTTTTTTTT", at=[(0, 6)])
    worth = torch.zeros_like(state.alpha)
    worth[0, 1, 12] = 1.0
    state = state.with_planes("values", Told(worth))
    state = state.replace(ground=state.ground.replace(alpha=state.alpha * 0 + 0.5))  # of each cell of the way, a half
    assert acts(state, env.world)[0].endswith("WEST"), "three cells away, and four"
    assert acts(state, replace(env.world, goal="worth_saved"))[0].endswith("EAST")
