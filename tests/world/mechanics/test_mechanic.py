"""What any mechanic may do to the worlds, by one that does a little of each."""

from dataclasses import dataclass
from typing import ClassVar

import pytest
import torch
from torch import Tensor

from tests.conftest import small_world
from tests.world.drawing import drawn
from tests.world.mechanics.drawing import begun
from warp_torchrl.world.arrays.batch import Batch, Named, concatenated
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.mechanics.mechanic import Mechanic
from warp_torchrl.world.mechanics.table import mechanic, mechanics
from warp_torchrl.world.state.saved import filled
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.team import Team


@dataclass(eq=False, repr=False)
class Steps(Batch):
    each: Tensor  # int32 [B], steps of running worlds


@dataclass(frozen=True)
class Counting(Mechanic):
    """Counts steps, and whose planes it saw when it began."""

    most_agents: int = 8

    def check(self, world):
        if world.team.n_agents > self.most_agents:
            raise ValueError(f"team.n_agents must be at most {self.most_agents}, got {world.team.n_agents}")

    def begin(self, state, world):
        return state.with_planes(self.name, Steps(torch.full_like(state.step, len(state.extras.held))))

    def step(self, before, after, running, world):
        each = after.planes(self.name, Steps).each
        return after.with_planes(self.name, Steps(each + running * (after.step - before.step)))


class First(Counting):
    name = "first"


class Second(Counting):
    name = "second"


def counts(state):
    return {name: planes.each.tolist() for name, planes in state.extras.held.items()}


def played(steps):
    world = small_world(mechanics=(Second(), First()), horizon=2)
    state = world.reset(torch.arange(3), torch.zeros(3, dtype=torch.int64))
    stay = torch.full((3, world.team.n_agents), 10)
    for _ in range(steps):
        state = world.step(state, stay).after
    return world, state


def test_mechanics_begin_in_the_order_of_their_names_and_step_where_worlds_go_on():
    assert counts(played(0)[1]) == {"first": [0] * 3, "second": [1] * 3}
    assert counts(played(3)[1]) == {"first": [2] * 3, "second": [3] * 3}, "the horizon ends the worlds"


def test_planes_are_chosen_joined_saved_and_read_back_with_the_worlds():
    _, state = played(1)
    one = concatenated([state[:1], state[2:]])
    assert counts(one) == {"first": [1] * 2, "second": [2] * 2} and counts(state.clone().to("cpu")) == counts(state)
    kept = {name: leaf.clone() for name, leaf in state.what_changes().items()}
    assert torch.equal(kept["extras.first.each"], torch.ones(3, dtype=torch.int32))
    assert counts(filled(played(0)[1], kept)) == counts(state)
    with pytest.raises(ValueError, match="must have the entries"):
        filled(state, {name: leaf for name, leaf in kept.items() if name != "extras.first.each"})


def test_planes_that_no_mechanic_began_are_missed_by_name():
    _, state = played(0)
    with pytest.raises(ValueError, match="worlds must have planes of third, got those of first, second"):
        state.planes("third", Steps)
    assert state.plane("third", "each") is None and torch.equal(state.plane("first", "each"), torch.zeros(3))
    assert Named().leaves() == {}


def test_no_mechanic_has_the_name_of_planes_that_the_law_keeps():
    class Rate(Counting):
        name = "rate"

    small_world(mechanics=(Rate(),))
    with pytest.raises(ValueError, match=r"mechanics must be one of each name, got rate, .*rate"):
        small_world(mechanics=(Rate(),), fire=RateFire())


def test_a_world_refuses_what_does_not_fit_it():
    with pytest.raises(ValueError, match="n_agents must be at most 8, got 9"):
        small_world(mechanics=(First(),), team=Team(n_agents=9), landscape=small_world().landscape)
    with pytest.raises(ValueError, match=r"mechanics must be one of each name, got .*first, first"):
        small_world(mechanics=(First(), First()))


def test_the_table_holds_what_the_folders_and_users_add(monkeypatch):
    known = {**mechanics(), "taken": Mechanic}
    monkeypatch.setattr("warp_torchrl.world.mechanics.table._TABLE", known)
    mechanic("counting")(Counting)
    assert Counting.name == "counting" and mechanics()["counting"] is Counting
    with pytest.raises(ValueError, match="taken must be a new mechanic's name"):
        mechanic("taken")(Counting)


class Holding(Mechanic):
    """Holds back the act of the first agent, and finds that of the last useful."""

    name = "holding"

    def around(self, state, attempts, take_effect):
        first, last = torch.tensor([[True, False, False]]), torch.tensor([[False, False, True]])
        acts, water = attempts.acts & ~first, attempts.takes_water & ~first
        return take_effect(state, attempts._replace(acts=acts, takes_water=water, is_useful=last))


class After(Mechanic):
    """Tells who is left to act, once a mechanic of a later name has held acts back, and lets them."""

    name = "after"
    seen: ClassVar[list[Tensor]] = []

    def around(self, state, attempts, take_effect):
        self.seen[:] = [attempts.acts, attempts.target, attempts.origin, state.cells]
        return take_effect(state, attempts)


@pytest.mark.parametrize("rules", [(), (After(), Holding())])
def test_an_act_that_a_mechanic_holds_back_does_not_happen(rules):
    extinguish, east = int(Action.EXTINGUISH), int(Action.EAST)
    world = small_world(mechanics=rules, team=Team(n_agents=3, tank=3), steps_per_tick=9)
    state = begun(world, (1, 0), (1, 2), (3, 0), drawing="TTT TaT TTT TTT")
    result, after = (made := world.step(state, torch.tensor([[extinguish, extinguish, east]]))).result, made.after
    assert drawn(after) == "TTT TTT TTT TTT" and result.moved.tolist() == [[False, False, True]]
    assert result.credited.tolist() == [[not rules, bool(rules), False]]
    assert result.redundant.tolist() == [[False, not rules, False]]
    assert after.vehicles.tank.tolist() == [[3 if rules else 2, 2, 3]] and after.vehicles.acts.tolist() == [[1, 1, 0]]
    assert after.vehicles.last_useful.tolist() == ([[-1, 0, 0]] if rules else [[0, -1, -1]])
    if rules:
        acts, target, origin, cells = After.seen
        assert acts.tolist() == [[False, True, False]] and target[0, 1] == 4 and cells[0, 1, 1] > 10
        assert origin.tolist() == [[[1, 0], [1, 2], [3, 0]]]
