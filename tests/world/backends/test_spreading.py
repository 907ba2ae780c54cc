"""Fires alone compute the times of the law."""

import torch

from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.backends.backend import Reference
from warp_torchrl.world.backends.spreading import Hour, Spreading
from warp_torchrl.world.backends.tick import in_wind, initial_state
from warp_torchrl.world.law.arrivals import arrivals_in
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.landscape import Perlin

FIRE = RateFire(model="fbp", minutes_per_tick=2.0, cell_deviation=0.3, residence=1e4)
WINDS = torch.tensor([[2.0, 3.0], [-4.0, 1.0], [0.0, -5.0]])


def started() -> WorldState:
    key = world_key(torch.zeros(2, dtype=torch.int64))  # one landscape
    ground = Perlin(size=32, relief=150.0)(key)
    lit = torch.zeros_like(ground.age, dtype=torch.bool)
    lit[:, 14:17, 14:17] = ground.age[:, 14:17, 14:17] > 0
    nobody = Team(n_agents=1).place(key, ground.cover, lit)
    keys = world_key(torch.arange(2))
    state = initial_state(ground, FIRE, WINDS[:1, :, None, None].expand(2, -1, -1, -1), keys, nobody, 30.0)
    return FIRE.started(state.replace(cells=torch.where(lit, 11, state.cells).to(torch.uint8)))


def test_times_are_those_of_the_law_in_weather_that_changes() -> None:
    state, ticks = started(), 12
    fuel = (state.alpha[0] > 0.0) & (state.landscape.age[0] > 0)
    hours = []
    fires = Spreading(state.cells == 11, fuel, state.ground.terms.pace)
    for wind in WINDS:
        if hours:
            state = in_wind(state, FIRE, wind[None, :, None, None].expand(2, -1, -1, -1))
        hours.append(Hour(state.air.terms.travel[0], FIRE.minutes, ticks))
        for _ in range(ticks):
            before = state
            state = Reference(FIRE).tick(state, torch.ones(2, dtype=torch.bool))
            assert (state.tick == before.tick + 1).all()
    fires.burn(hours)
    burned = state.cells > 10
    assert torch.equal(fires.arrival() < NEVER / 2, burned)
    assert burned.sum() > 150
    # The last hour's are those in force; earlier ones were scaled as the weather changed.
    late = burned & (fires.arrival() > 2 * ticks * FIRE.minutes)
    assert torch.allclose(fires.arrival()[late], arrivals_in(state).minutes[late], rtol=1e-5)


def test_hours_in_two_goes_are_hours_in_one() -> None:
    state = started()
    fuel = (state.alpha[0] > 0.0) & (state.landscape.age[0] > 0)
    hours = [Hour(state.air.terms.travel[0], 2.0, 10), Hour(state.air.terms.travel[0], 1.0, 20)]
    whole = Spreading(state.cells == 11, fuel, state.ground.terms.pace)
    whole.burn(hours)
    one = Spreading((state.cells == 11)[:1], fuel, state.ground.terms.pace[:1])
    one.burn(hours)
    assert torch.equal(whole.arrival()[:1], one.arrival())
