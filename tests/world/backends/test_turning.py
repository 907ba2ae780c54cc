"""A fire in a wind that wanders: at the trees beside it, and on demand, as on whole maps."""

import pytest
import torch

from warp_torchrl.system.device import unread
from warp_torchrl.world.air.wind import Uniform, Wandering
from warp_torchrl.world.backends import backend
from warp_torchrl.world.backends.on_demand import OnDemand
from warp_torchrl.world.law.arrivals import Travel, arrivals_in, metric, metric_at
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import World

WANDERING = Wandering(speed=7.0)
LAWS = {
    "rothermel": RateFire(fire_deviation=0.2, cell_deviation=0.3),
    "canadian": RateFire(model="fbp", cell_deviation=0.3),
}


def world_of(fire: RateFire, wind: Wandering | Uniform = WANDERING, size: int = 24) -> World:
    return World(fire=fire, wind=wind, landscape=Perlin(size=size, relief=200.0), steps_per_tick=1)


def worlds(world: World) -> WorldState:
    return world.reset(torch.arange(5), torch.zeros(5, dtype=torch.int64))


def in_whole_air(state: WorldState, fire: RateFire, wind: torch.Tensor) -> WorldState:
    """Worlds in another wind by the law alone, on whole maps."""
    kept = state.replace(air=fire.air(state.wind, None, state.ground))
    return fire.in_air(kept, fire.air(wind, None, state.ground))


@pytest.mark.parametrize("name", LAWS)
def test_a_fire_turns_as_on_whole_maps_to_the_bit(name: str) -> None:
    world, turned = world_of(LAWS[name]), 0
    state, fire = worlds(world), world.fire
    generator = torch.Generator().manual_seed(0)
    for _ in range(25):
        state = world.step(state, torch.randint(0, 10, (5, world.team.n_agents), generator=generator)).after
        wind = state.wind + torch.randn(5, 2, 1, 1, generator=generator)
        ours, theirs = backend.in_wind(fire, state, wind, None), in_whole_air(state, fire, wind)
        for part in ("minutes", "origin"):
            assert torch.equal(getattr(arrivals_in(ours), part), getattr(arrivals_in(theirs), part)), part
        assert isinstance(ours.air.terms, OnDemand)
        turned += int((arrivals_in(ours).minutes != arrivals_in(state).minutes).sum())
        for one, other in zip(metric(ours.ground, ours.air), metric(theirs.ground, theirs.air), strict=True):
            assert torch.equal(one, other)
    assert turned > 1000


@pytest.mark.parametrize("turning", [1, 4, 5])
@pytest.mark.parametrize("wind", [WANDERING, Uniform(speed=7.0)], ids=["wandering", "uniform"])
def test_worlds_whose_wind_stays_do_not_turn_with_others(wind: Wandering | Uniform, turning: int) -> None:
    # Maps of 11 x 11 do not fill vectors: terms on whole maps depend on a world's place among those they are made for.
    world = world_of(LAWS["canadian"], wind, size=11)
    state = world.reset(torch.arange(8), torch.zeros(8, dtype=torch.int64))[torch.tensor([7, 2, 4, 1, 5])]
    for _ in range(10):
        state = world.step(state, torch.zeros(5, world.team.n_agents, dtype=torch.int64)).after
    other = state.wind.clone()
    other[:turning] += 3.0
    before = [each[turning:].clone() for each in metric(state.ground, state.air)]
    ours = backend.in_wind(world.fire, state, other, None)
    for part in ("minutes", "origin"):
        one, old = (getattr(arrivals_in(each), part) for each in (ours, state))
        assert torch.equal(one[turning:], old[turning:])
    for one, old in zip(metric(ours.ground, ours.air), before, strict=True):
        assert torch.equal(one[turning:], old)
    assert not torch.equal(arrivals_in(ours).minutes[0], arrivals_in(state).minutes[0])


def test_cells_are_made_once_in_any_order_and_company() -> None:
    world = world_of(LAWS["rothermel"])
    state = worlds(world)
    alone = [metric_at(state.ground, state.air, torch.tensor([cell]))[0] for cell in (7, 2000, 2879)]
    terms = state.air.terms
    assert isinstance(terms, OnDemand)
    asked = {7, 2000, 2879} | set(terms.known.flatten().nonzero()[:, 0].tolist())
    assert len(asked) < terms.known.numel() / 4, "whole maps were made"
    terms.made.view(-1)[7] = 1.0  # it is not made again
    again = metric_at(state.ground, state.air, torch.tensor([2879, 7, 2000]))[0]
    assert torch.equal(again[[2, 0]], torch.cat(alone[1:]))
    assert again[1].item() == pytest.approx(world.fire.pace(state.key, (24, 24)).flatten()[7].item())


def test_worlds_of_inference_mode_go_on_outside_of_it() -> None:
    world = world_of(LAWS["rothermel"])
    actions = torch.zeros(5, world.team.n_agents, dtype=torch.int64)
    with torch.inference_mode():
        begun = worlds(world)
    ours, theirs = (world.step(state, actions).after for state in (begun, worlds(world)))
    assert torch.equal(arrivals_in(ours).minutes, arrivals_in(theirs).minutes)
    for one, other in zip(metric(begun.ground, begun.air), metric(theirs.ground, worlds(world).air), strict=True):
        assert torch.equal(one, other)


def test_what_the_wind_makes_is_kept_where_it_lasts_or_nothing_is_read() -> None:
    fire = LAWS["rothermel"]
    assert isinstance(worlds(world_of(fire, Uniform(speed=7.0))).air.terms, Travel)
    with unread():
        assert isinstance(worlds(world_of(fire)).air.terms, Travel)


def test_a_wandering_wind_comes_to_the_same_worlds_without_reading() -> None:
    world = world_of(LAWS["rothermel"])
    actions = torch.randint(0, 10, (40, 5, world.team.n_agents), generator=torch.Generator().manual_seed(1))

    def burned() -> WorldState:
        state = worlds(world)
        for each in actions:
            state = world.step(state, each).after
        return state

    ours = burned()
    with unread():
        theirs = burned()
    changed, same = ours.what_changes(), theirs.what_changes()
    assert [name for name, leaf in changed.items() if not torch.equal(leaf, same[name])] == []
    assert (ours.cells > 10).any()
