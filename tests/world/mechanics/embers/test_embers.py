"""Embers by hand: where they fall, when they start fires, and what they leave alone."""

import math

import pytest
import torch

from tests.conftest import small_world
from tests.world.drawing import differing
from tests.world.mechanics.drawing import begun
from tests.world.mechanics.there import needs
from warp_torchrl import make_env
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.system.device import unread
from warp_torchrl.world.air.wind import Uniform
from warp_torchrl.world.arrays.shortlist import first_cells
from warp_torchrl.world.behaviour.firebrands import Firebrands
from warp_torchrl.world.law.arrivals import arrivals_in
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.mechanics.embers.embers import Embers, Fallen, most_cells
from warp_torchrl.world.state.cells import count_trees, is_burning
from warp_torchrl.world.state.records import in_sight

RIVER = " ".join(["TaTTT~~~TTTTTT"] * 8)
EAST = (8.0, 0.0)
CERTAIN = Embers(chance=1.0, distance=0.75, deviation=0.1, sideways=0.0)


def fallen(state):
    return state.planes("embers", Fallen)


def world_of(embers, fire=None, **options):
    fire = Fire(youngest_fuel=1) if fire is None else fire
    return small_world(mechanics=() if embers is None else (embers,), fire=fire, wind=Uniform(speed=8.0), **options)


def burn(world, steps, drawing=RIVER, worlds=4, wind=EAST):
    """Drawn worlds after some steps in which nobody acts, a tick each."""
    state = begun(world, (0, 0), (0, 1), drawing=drawing, fire=world.fire, worlds=worlds, wind=wind)
    state = world.fire.started(state)
    for _ in range(steps):
        state = world.step(state, torch.full((worlds, 2), 10)).after
    return state


def touched(state):
    return is_burning(state.cells) | state.burned


LAWS = {
    "spread": (Fire(youngest_fuel=1), CERTAIN),
    "hazard": (HazardFire(youngest_fuel=1, refinement=2), CERTAIN),
    "rate": (
        RateFire(cell_deviation=0.0, fuel_of_cover=(98, 102, 104, 165, 99), minutes_per_tick=1.0),
        Embers(firebrands=Firebrands(per_heat=1e3, least_intensity=0.0, delay=0.0)),
    ),
}


@pytest.mark.parametrize("law", LAWS)
def test_fire_jumps_a_river_where_embers_fall_and_not_without(law):
    fire, embers = LAWS[law]
    plain, jumped = (burn(world_of(each, fire, steps_per_tick=1), 20) for each in (None, embers))
    assert not touched(plain)[:, :, 8:].any()
    assert touched(jumped)[:, :, 8:].flatten(1).any(1).all() and (fallen(jumped).spots > 0).all()
    assert not touched(jumped)[:, :, 5:8].any(), "water does not burn"


def test_without_chance_or_heat_nothing_changes_to_the_bit():
    for law, none in (("spread", Embers(chance=0.0)), ("rate", Embers(firebrands=Firebrands(per_heat=0.0)))):
        plain, off = (burn(world_of(each, LAWS[law][0], steps_per_tick=1), 12) for each in (None, none))
        assert not differing(plain, off.without_planes("embers"))


def test_a_tree_throws_as_far_as_told_and_downwind():
    # From column 1, in a wind of 8 m/s: the median is 0.75 x 8 = 6 cells, so half land beyond column 7.
    embers = Embers(chance=1.0, distance=0.75, deviation=0.5, sideways=0.0)
    world = world_of(embers, steps_per_tick=1)
    state = burn(world, 1, drawing="a" + "." * 40, worlds=4000)
    falls = fallen(state).falls[:, 0] > 0
    lands = falls.float().argmax(1)[falls.any(1)].float()
    assert falls.sum(1).max() == 1 and (falls.sum(1) == 1).float().mean() > 0.99
    assert lands.median().item() == 6.0
    beyond = 0.5 * math.erfc(math.log(10.5 / 6.0) / 0.5 / math.sqrt(2.0))
    assert (lands > 10).float().mean().item() == pytest.approx(beyond, rel=0.1)
    north = burn(world, 1, drawing=" ".join(["."] * 20 + ["a"]), wind=(0.0, 8.0), worlds=500)
    assert (fallen(north).falls > 0).any() and not (fallen(burn(world, 1, wind=(0.0, 0.0))).falls > 0).any()


def test_an_ember_that_smoulders_keeps_the_episode_and_starts_a_fire_when_it_is_due():
    fire = LAWS["rate"][0]
    world = world_of(Embers(firebrands=Firebrands(delay=3.0)), fire, steps_per_tick=1)
    state = burn(world, 0, drawing="TTTTTT TTTTTT", worlds=2)
    due = fallen(state).due.clone()
    due[0, 1, 4] = 2.0
    due[1, 0, 0] = 2.0
    state = state.with_planes("embers", fallen(state).replace(due=due))
    state = state.replace(wet=state.wet + (torch.arange(2)[:, None, None] == 1).to(torch.uint8) * 99)
    one = world.step(state, torch.full((2, 2), 10)).after
    assert not one.terminated.any() and not is_burning(one.cells).any()
    two = world.step(one, torch.full((2, 2), 10))
    assert is_burning(two.after.cells)[0].nonzero().tolist() == [[1, 4]]
    assert arrivals_in(two.after).minutes[0, 1, 4] == 2.0 and two.counts_after.alight.tolist() == [1, 0]
    assert fallen(two.after).spots.tolist() == [1, 0], "a wet tree puts it out"
    assert world.step(two.after, torch.full((2, 2), 10)).after.terminated.tolist() == [False, True]


@pytest.mark.parametrize("law", LAWS)
def test_a_world_is_the_same_in_any_batch_and_where_nothing_is_read(law):
    world = world_of(LAWS[law][1], LAWS[law][0], steps_per_tick=2)
    many, few = (burn(world, 16, worlds=n) for n in (128, 64))
    assert not differing(many[torch.arange(64)], few)
    with unread():
        assert not differing(few, burn(world, 16, worlds=64))


def test_cells_over_the_limit_throw_in_the_next_tick():
    mask = torch.zeros(2, 4, 5, dtype=torch.bool)
    mask[0, 1, 2:], mask[1, 0, 0] = True, True
    cell, there = first_cells(mask, 2)
    assert cell[there].tolist() == [7, 8, 0] and there.tolist() == [[True, True], [True, False]]
    state = burn(world_of(LAWS["rate"][1], LAWS["rate"][0], steps_per_tick=1), 0, drawing=" ".join(["T" * 12] * 12))
    state = state.replace(cells=torch.full_like(state.cells, 11))
    state = LAWS["rate"][0].started(state)
    threw = []
    for _ in range(4):
        state = LAWS["rate"][1].after_tick(state, state.tick >= 0, world_of(*LAWS["rate"][::-1]))
        threw.append(fallen(state).thrown[0].sum().item())
    assert most_cells(state) == 64 and threw == [64, 128, 144, 144]


def test_agents_see_where_embers_fall_and_tables_tell_of_spot_fires():
    env = make_env("embers", n_worlds=8, overrides=["observation.features=[embers]"])
    shown = env.rollout(60, HEURISTICS["greedy"](env), break_when_any_done=False)["next"]
    assert shown["info", "spot_fires"][:, -1].max() > 0.0
    assert any("embers" in names for names in env.channel_names.values())


@pytest.mark.slow
def test_a_compiled_step_is_the_eager_one():
    from warp_torchrl.env import WildfireEnv

    world = world_of(Embers(chance=0.2), steps_per_tick=2)
    worlds = [WildfireEnv(world, n_worlds=2, fuse=fuse) for fuse in (False, True)]
    for env in worlds:
        now = env.reset()
        for _ in range(16):
            now["agents", "action"] = torch.full((2, 2), 10)
            now = env.step(now)["next"]
    assert worlds[1].why_eager is None and (fallen(worlds[0].world_state).spots > 0).any()
    one, other = (env.world_state.leaves() for env in worlds)
    assert all(torch.equal(one[name], other[name]) for name in one)


def test_what_another_law_reads_is_refused():
    with pytest.raises(ValueError, match=r"embers\.chance is read under other laws than rate alone"):
        world_of(Embers(chance=0.5), RateFire())
    with pytest.raises(ValueError, match=r"embers\.firebrands is read under law rate alone"):
        world_of(Embers(firebrands=Firebrands(delay=1.0)))
    with pytest.raises(ValueError, match="chance must be in"):
        Embers(chance=1.5)


@needs("sensing", "radio", "belief")
def test_embers_that_nobody_sees_are_shown_to_nobody_and_stand_in_no_future():
    overrides = ["mechanics.embers.chance=0.0", "belief=ensemble", "landscape.size=16"]
    overrides += ["observation=surroundings", "observation.features=[embers]"]
    env = make_env("search", n_worlds=2, overrides=overrides)
    env.reset()
    state, seen = env.world_state, in_sight(env.world_state)
    everywhere = torch.full_like(state.cells, 255)
    theirs = state.with_planes(
        "embers", fallen(state).replace(falls=everywhere, due=fallen(state).due * seen.any(dim=1))
    )
    ours, others = (env.world.futures(each, 3) for each in (state, theirs))
    assert not differing(ours, others)
    unseen = state.with_planes("embers", fallen(state).replace(falls=everywhere * ~seen.any(dim=1)))
    shown = [env._scene.observe(each, count_trees(each)) for each in (state, unseen, theirs)]
    for name in ("view", "picture"):
        before, same, other = (each.entries[name] for each in shown)
        assert torch.equal(before, same) and not torch.equal(before, other), name
    assert not torch.equal(shown[0].state, shown[1].state), "the critic sees all"
