"""Beliefs of worlds drawn by hand, and which worlds may have them."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.drawing import drawn
from tests.world.mechanics.belief.drawing import believing, members
from tests.world.mechanics.belief.worlds import alight, begun, reset, rules, stay
from tests.world.mechanics.drawing import begun as drawn_world
from tests.world.mechanics.drawing import later
from tests.world.mechanics.there import needs
from warp_torchrl import make_env
from warp_torchrl.runs.config.compose import ConfigError
from warp_torchrl.world.mechanics.belief.belief import Ensemble
from warp_torchrl.world.mechanics.belief.beliefs import (
    beliefs_of,
    disagreement,
    known_probability,
    most_believed,
)
from warp_torchrl.world.state.state import Action


def test_with_perfect_sight_members_are_the_fire():
    world = rules(radius=12)
    state = reset(world, 2)
    for _ in range(5):
        cells = beliefs_of(state).members.held["cells"]
        assert torch.equal(cells, state.cells[:, None].expand_as(cells))
        assert torch.equal(world.assumed(state).cells, state.cells)
        state = world.step(state, stay(state)).after
    assert all(each.metrics(state)["jaccard"].eq(1.0).all() for each in world.loop if each.name == "belief")


def test_a_fire_that_was_seen_once_goes_on_growing_while_nobody_looks():
    world = rules(steps_per_tick=1, belief=Ensemble(members=4, hidden=0))
    state = begun(world, alight(world, begun(world, reset(world), drop=True), (5, 2)), (5, 0), (5, 1))
    assert [each.count("a") for each in members(state)] == [1] * 4
    away = torch.tensor([[[0, 11], [1, 11]]])
    state = state.replace(vehicles=state.vehicles.replace(position=away))
    sizes = []
    for _ in range(4):
        sizes.append((beliefs_of(state).members.held["cells"] > 10).sum().item())
        state = world.step(state, stay(state)).after
    assert sizes == sorted(sizes) and sizes[-1] > 3 * sizes[0]
    assert (known_probability(beliefs_of(state)) > 0).sum() > (world.assumed(state).cells > 10).sum(), "members differ"


def test_a_fire_that_is_put_out_in_sight_is_out_in_members():
    world = rules(radius=2, steps_per_tick=5, belief=Ensemble(members=4, hidden=0))
    state = begun(world, alight(world, begun(world, reset(world), drop=True), (5, 2), (11, 11)), (5, 2), (5, 1))
    assert all("a" in each for each in members(state))
    action = torch.tensor([[int(Action.EXTINGUISH), int(Action.STAY)]])
    after = world.step(state, action).after
    held = beliefs_of(after).members.held
    assert not any("a" in each for each in members(after))
    assert (held["wet"][0, :, 5, 2] == after.wet[0, 5, 2]).all() and after.wet[0, 5, 2] > 0


def test_what_one_agent_sees_the_other_believes_only_if_they_share_maps():
    drawing = "TTTTTTTTTTT TTTTTTTTTTT TTTTTTTTTTa"
    for of, first, second in (("team", 1, 1), ("agent", 0, 1)):
        world = rules(belief=Ensemble(of=of, members=2, hidden=0), shares=of == "team")
        state = drawn_world(world, (0, 0), (2, 9), drawing=drawing)
        found = [
            sum(each.count("a") for each in members(state, belief)) // 2 for belief in ((0, 0), (0, 1))[of == "agent"]
        ]
        assert found == [first, second]
    gone = later(state, world, (0, 0), (0, 0))
    assert known_probability(beliefs_of(gone))[0, 1, 2, 10] == 1.0, "it is remembered"


def test_a_cell_is_what_members_that_weigh_most_say():
    # The weight of fire is 0.6, 0.4, 0 and 0.6, of empty ground 0, 0, 0.6 and 0.4
    state = believing("TTTT", "TbT.", "aT.b", "aT.b", weights=[0.4, 0.3, 0.3])
    assert known_probability(beliefs_of(state)).flatten().tolist() == pytest.approx([0.6, 0.4, 0.0, 0.6])
    assert disagreement(beliefs_of(state)).flatten().tolist() == pytest.approx([0.96, 0.96, 0.0, 0.96])
    assumed = most_believed(state, 0.5)
    assert drawn(assumed) == "bT.b" and assumed.age.flatten().tolist() == [10, 0, 0, 10]
    assert drawn(most_believed(state, 0.3)) == "bb.b" and drawn(most_believed(state, 0.7)) == "TT.T"


def test_futures_are_members_as_often_as_they_weigh():
    world = rules(belief=Ensemble(members=3, hidden=0))
    state = reset(world)
    held = beliefs_of(state)
    ages = torch.tensor([1, 2, 3], dtype=torch.uint8)[:, None, None].expand(-1, 12, 12)[None]
    held = held.replace(
        members=held.members.replace(cells=ages.contiguous()), weights=torch.tensor([[[0.25, 0.75, 0.0]]])
    )
    futures = world.futures(state.with_planes("belief", held), 4)
    assert futures.cells[:, 0, 0].tolist() == [1, 2, 2, 2]


def test_worth_seeing_is_doubt_and_staleness():
    world = rules(belief=Ensemble(members=2, hidden=0))
    state = drawn_world(world, (0, 0), (0, 0), drawing="TTTTTT TTTTTT")
    held = beliefs_of(state)
    cells = held.members.held["cells"].clone()
    cells[:, 0, 1, 5] = 11
    state = state.with_planes("belief", held.replace(members=held.members.replace(cells=cells)))
    worth = world.worth_seeing(state)
    assert worth.shape == (1, 1, 2, 6) and worth[0, 0, 0, 0] == 0.0
    assert worth[0, 0, 1, 4:].tolist() == pytest.approx([0.001, 0.251])


def test_smoke_without_a_known_fire_is_worth_seeing():
    world = rules(belief=Ensemble(members=2, hidden=0), sight={"smoke": 100.0})
    state = drawn_world(world, (0, 2), (2, 2), drawing="aTTTTT TTTTTT TTTTTT", wind=(5.0, 0.0))
    assert world.worth_seeing(state)[0, 0, 0].argmax() < 3 and (world.worth_seeing(state)[0, 0, 0, :3] > 0.3).all()


def test_members_are_weighed_where_sight_errs_unless_one_says_otherwise():
    exact, errs = rules(), rules(sight={"miss": 0.1})
    assert exact.belief.trusts(exact) == 0.0 and errs.belief.trusts(errs) == 1.0
    assert Ensemble(trust=0.3).trusts(exact) == 0.3 and Ensemble(members=1).trusts(errs) == 0.0


def test_a_team_without_shared_maps_has_no_belief_of_its_own():
    with pytest.raises(ValueError, match="must be agent where the team"):
        rules(shares=False)
    assert rules(shares=False, belief=Ensemble(of="agent")).belief.of == "agent"
    with pytest.raises(ValueError, match="belief must be none where agents see all"):
        small_world(belief=Ensemble(of="agent"))
    with pytest.raises(ValueError, match="members must be in"):
        Ensemble(members=0)


@needs("radio", "sensing")
def test_the_option_shares_maps_and_leaves_the_radio_to_the_user():
    world = make_env("scouts", n_worlds=1, overrides=["belief=ensemble", "landscape.size=16"]).world
    assert world.hearing.sends_maps and world.hearing.is_everywhere and world.belief.of == "team"
    far = ["belief=ensemble", "mechanics.radio.range=5", "landscape.size=16"]
    with pytest.raises(ConfigError, match="must be agent where the team"):
        make_env("scouts", n_worlds=1, overrides=far)
    env = make_env("scouts", n_worlds=1, overrides=[*far, "belief.of=agent"])
    env.rollout(2)
    assert env.world.hearing.range == 5.0 and beliefs_of(env.world_state).weights.shape[1] == env.n_agents
    with pytest.raises(ConfigError, match=r"^belief must be none where agents see all"):
        make_env("scouts", n_worlds=1, overrides=["belief=ensemble", "sensing=full"])
