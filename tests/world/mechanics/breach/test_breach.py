"""Firebreaks that flames reach over, by hand."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.drawing import differing, drawn
from tests.world.mechanics.drawing import begun
from warp_torchrl.system.device import unread
from warp_torchrl.world.air.wind import Uniform
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.mechanics.breach.breach import Breach, Breaches

WALL = " ".join(["TaT#TTTT"] * 8)
FOREST = " ".join(["ffffffff"] * 8)
SPREAD = Fire(youngest_fuel=1)
RATE = RateFire(cell_deviation=0.0, fuel_of_cover=(98, 102, 104, 145, 99), minutes_per_tick=1.0)


def burned(breach, steps, fire=SPREAD, worlds=64, drawing=WALL, ground=FOREST):
    """Drawn worlds after some steps in which nobody acts, a tick each."""
    mechanics = () if breach is None else (breach,)
    world = small_world(mechanics=mechanics, fire=fire, wind=Uniform(speed=8.0), steps_per_tick=1)
    state = begun(world, (0, 0), (0, 1), drawing=drawing, ground=ground, fire=fire, worlds=worlds, wind=(8.0, 0.0))
    state = fire.started(state)
    for _ in range(steps):
        state = world.step(state, torch.full((worlds, 2), 10)).after
    return state


def share_beyond(state):
    return (state.initial & (state.cells != 10)).flatten(2)[:, :, 4:].flatten(1).any(1).float().mean().item()


def test_a_firebreak_that_is_narrow_for_the_flames_is_breached_and_a_wide_one_holds():
    assert share_beyond(burned(None, 12)) == 0.0
    # Flames of 3 m, 2,830 kW/m; with trees: of a part of 30 m 1 - (1 - 0.62)^0.3 = 0.25 at 5 m, eight parts 0.90.
    assert share_beyond(burned(Breach(), 12)) == pytest.approx(0.90, abs=0.1)
    assert share_beyond(burned(Breach(width=40.0), 12)) == 0.0
    assert share_beyond(burned(Breach(width=5.0, flame_length=8.0), 12)) == 1.0
    # Without trees 1 / (1 + exp(-1.36 - 1.02 + 0.99 x 5)) = 0.07: of eight parts 1 - (1 - 0.07)^2.4 = 0.16.
    assert share_beyond(burned(Breach(), 12, ground="")) == pytest.approx(0.16, abs=0.12)


def test_fire_reaches_the_cell_straight_beyond_and_no_farther():
    # The strongest flames breach 30 m with a chance of 1 - 0.0007^0.3 = 0.89.
    one = burned(Breach(width=0.5, flame_length=50.0), 1, drawing="T.a#TTT", ground="fffffff")
    ways = [drawn(one, world) for world in range(64)]
    assert set(ways) == {"T.b.aTT", "T.b.TTT"} and ways.count("T.b.aTT") / 64 == pytest.approx(0.89, abs=0.1)
    assert one.planes("breach", Breaches).count.sum() == ways.count("T.b.aTT")
    two = burned(Breach(width=0.5, flame_length=50.0), 6, drawing="T.a##TT", ground="fffffff", worlds=8)
    assert not two.planes("breach", Breaches).count.any()


def test_under_law_rate_the_front_decides():
    litter = RateFire(cell_deviation=0.0, fuel_of_cover=(98, 102, 104, 181, 99), minutes_per_tick=1.0)
    beside = " ".join(["TTa#TTTT"] * 8)
    weak, strong = (share_beyond(burned(Breach(width=8.0), 1, fire, drawing=beside)) for fire in (litter, RATE))
    # Of eight parts of 30 m, 1 - (1 - P)^2.4: 0.34 at 0 kW/m, 0.83 at 5,000.
    assert 0.1 < weak < 0.6 and strong > 0.93


@pytest.mark.parametrize("fire", [SPREAD, RATE], ids=["spread", "rate"])
def test_a_world_is_the_same_in_any_batch_and_where_nothing_is_read(fire):
    many, few = (burned(Breach(), 10, fire, worlds=n) for n in (128, 64))
    assert not differing(many[torch.arange(64)], few)
    with unread():
        assert not differing(few, burned(Breach(), 10, fire, worlds=64))


def test_a_length_of_flames_under_law_rate_is_refused():
    with pytest.raises(ValueError, match=r"breach\.flame_length is read under other laws than rate alone"):
        small_world(mechanics=(Breach(flame_length=2.0),), fire=RateFire())
    with pytest.raises(ValueError, match="width must be in"):
        Breach(width=0.0)
