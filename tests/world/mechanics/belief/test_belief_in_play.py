"""Beliefs in play: what nobody saw changes nothing, any batch gives the same, and what was kept goes on."""

from typing import NamedTuple

import pytest
import torch

from tests.world.drawing import differing
from tests.world.mechanics.belief.worlds import LAWS, alight, begun, reset, rules, stay
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.world.mechanics.belief.belief import Ensemble
from warp_torchrl.world.mechanics.belief.beliefs import beliefs_of, cells_of
from warp_torchrl.world.team.knowledge import Belief
from warp_torchrl.world.world import World

UNKNOWN = Ensemble(members=4, hidden=8, rate_deviation=0.4, wind_speed_deviation=0.3, bearing_deviation=20.0)
AT = (5, 0), (5, 1)
BELIEFS = {
    "none, apart": None,
    "none": Belief(),
    "team": UNKNOWN,
    "agent": Ensemble(of="agent", members=2, hidden=4),
}
OF_FIRE = (
    *("cells", "age", "stage_age", "extinguished", "burned", "firebreak", "wet"),
    *("extras.rate.minutes", "extras.rate.origin"),
)
"""What of a state tells of the fire."""
METRIC = ("overlap", "union", "skill", "skills", "alight")


def alternately(beliefs, options):
    """Each belief under each law with each of two options; slow with one, in turns."""
    return [
        pytest.param(
            beliefs[belief],
            law,
            options[option],
            id=f"{belief}-{law}-{option}",
            marks=[pytest.mark.slow] if (b + n + o) % 2 else [],
        )
        for b, belief in enumerate(beliefs)
        for n, law in enumerate(LAWS)
        for o, option in enumerate(options)
    ]


class Rules(NamedTuple):
    """What a heuristic reads of an environment."""

    world: World


def acted(world, state, name):
    """What a heuristic does in worlds."""
    return HEURISTICS[name](Rules(world)).act(state, world.possible_actions(state))


def believed(state):
    """The names and values of what is believed; what metrics keep compares it with the fire."""
    leaves = state.leaves().items()
    return {name: leaf for name, leaf in leaves if name.startswith("extras.belief") and name[14:] not in METRIC}


@pytest.mark.parametrize(("belief", "law", "knows"), alternately(BELIEFS, {"known fire": True, "none": False}))
def test_what_nobody_saw_changes_nothing(law, belief, knows):
    world = rules(law, belief=belief or Belief(), shares=belief is not None and getattr(belief, "of", "team") == "team")
    state = begun(world, reset(world), *AT, drop=True)
    state = begun(world, alight(world, state, (11, 11), *[(5, 2)] * knows), *AT)
    wall = [(row, 5) for row in range(10)]
    theirs = alight(world, state, *wall)
    unseen = torch.arange(12) > 8
    theirs = theirs.replace(wet=theirs.wet + 3 * unseen.to(torch.uint8), extinguished=theirs.extinguished | unseen)
    ours, theirs = state, begun(world, theirs, *AT)
    for _ in range(4):
        own = believed(theirs)
        assert not [name for name, leaf in believed(ours).items() if not torch.equal(leaf, own[name])]
        assert not {*differing(world.assumed(ours), world.assumed(theirs))} & {*OF_FIRE}
        for name in ("dispatch", "coordinated"):
            assert torch.equal(acted(world, ours, name), acted(world, theirs, name)), name
        ours, theirs = (world.step(each, stay(each)).after for each in (ours, theirs))


def played(world, state, steps):
    for _ in range(steps):
        state = world.step(state, stay(state)).after
    return state


@pytest.mark.parametrize(
    ("belief", "law", "sight"),
    alternately(
        {"team": UNKNOWN, "agent": Ensemble(of="agent", members=3, hidden=5)},
        {"exact": {}, "errors": {"miss": 0.2, "false_alarm": 0.05}},
    ),
)
def test_a_batch_of_worlds_is_what_each_is_alone(law, belief, sight):
    world = rules(law, radius=2, sight=sight, belief=belief, shares=belief.of == "team")
    fires = ((5, 3),)
    state = begun(world, alight(world, reset(world, 3), *fires), *AT)
    together = played(world, state, 4)
    for one in (0, 2):
        alone, among = played(world, state[one : one + 1], 4), together[one : one + 1]
        assert law == "rate" or not differing(alone, among)
        for name, leaf in believed(among).items():  # rates of spread of one world are rounded otherwise
            torch.testing.assert_close(leaf, believed(alone)[name], rtol=1e-3, atol=1e-4)


def test_ended_worlds_do_not_change():
    world = rules(radius=2, belief=UNKNOWN)
    state = begun(world, alight(world, reset(world, 2), (5, 3)), *AT)
    ended = state.replace(truncated=torch.tensor([False, True]))
    after = played(world, ended, 4)
    assert not differing(after[1:], ended[1:])
    assert not differing(after[:1], played(world, state[:1], 4))
    assert not torch.equal(believed(after)["extras.belief.members.cells"][0], cells_of(beliefs_of(state))[0, 0])


@pytest.mark.parametrize("law", LAWS)
def test_what_is_kept_goes_on_exactly(law):
    env, other = (WildfireEnv(rules(law, radius=2, belief=UNKNOWN), n_worlds=2, seed=seed) for seed in (3, 9))
    env.rollout(5, break_when_any_done=False), other.reset()
    other.load_state_dict(env.state_dict())
    ours, theirs = (played(each.world, each.world_state, 4) for each in (env, other))
    assert not differing(ours, theirs) and "extras.belief.learning.particles" in ours.leaves()


def test_what_a_law_draws_of_the_ground_has_the_factor_of_the_rate_once():
    world = rules("rate", belief=UNKNOWN)
    state = begun(world, reset(world))
    pace = "extras.belief.members.ground.terms.pace"
    assert torch.equal(played(world, state, 4).leaves()[pace], state.leaves()[pace])
    assert not torch.equal(state.leaves()[pace][:, 0], state.leaves()[pace][:, 1]), "each member's are drawn"


def test_a_law_by_its_own_name_is_no_other_law():
    # What is made anew of the same law is the same to the bit, with what is known of wind and rate and without.
    for options in ({}, {"rate_deviation": 0.4, "wind_speed_deviation": 0.3, "particles": 16}):
        same, named = (
            rules(belief=Ensemble(members=4, hidden=8, kernel=kernel, **options)) for kernel in (None, "alexandridis")
        )
        ours, theirs = (
            played(world, begun(world, alight(world, reset(world), (5, 3)), *AT), 6) for world in (same, named)
        )
        own = believed(theirs)
        assert not [name for name, leaf in believed(ours).items() if not torch.equal(leaf, own[name])]


@pytest.mark.parametrize("law", ["paper", "hazard"])
def test_a_team_that_is_wrong_of_the_law_imagines_other_fires_in_the_same_world(law):
    right, wrong = (rules(law, belief=Ensemble(members=4, hidden=8, kernel=kernel)) for kernel in (None, "ellipse"))
    ours, theirs = (
        played(world, begun(world, alight(world, reset(world), (5, 3)), *AT), 8) for world in (right, wrong)
    )
    assert not {*differing(ours.without_planes("belief"), theirs.without_planes("belief"))}, "the world is the same"
    assert not torch.equal(cells_of(beliefs_of(ours)), cells_of(beliefs_of(theirs)))
    assert not torch.equal(beliefs_of(ours).soon, beliefs_of(theirs).soon)
    assumed = [world.assumed(state) for world, state in ((right, ours), (wrong, theirs))]
    assert not torch.equal(*(state.air.terms.gain for state in assumed)), "baselines reckon with the imagined law"


def test_a_law_without_a_kernel_is_refused():
    with pytest.raises(ValueError, match=r"belief\.kernel must be null under a law without one, got fbp"):
        rules("rate", belief=Ensemble(kernel="fbp"))


def test_where_fire_was_seen_does_not_depend_on_how_much_other_worlds_see():
    # Lists of sightings are as long as the longest; what fills up the others must not unsay their first cell.
    world = rules(radius=2, belief=Ensemble(members=2, hidden=4))

    def seen(*places):
        state = alight(world, reset(world, len(places)), (0, 0))
        position = torch.tensor(places, dtype=state.vehicles.position.dtype)
        return beliefs_of(begun(world, state.replace(vehicles=state.vehicles.replace(position=position)))).lit

    few, many = ((0, 0), (0, 1)), ((5, 3), (9, 9))
    assert seen(few)[0, 0, 0, 0]
    assert torch.equal(seen(few, many)[0], seen(few)[0])
