"""The canopy of landscapes under law rate: shelter, fires in crowns, and what maps lack."""

from dataclasses import fields

import pytest
import torch

from warp_torchrl import rate_of_spread
from warp_torchrl.world.behaviour.moistures import MOISTURES, moisture_row
from warp_torchrl.world.behaviour.spread import Spread
from warp_torchrl.world.law.canopy import lack_of_canopy
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import Landscape

TREES = {"canopy_cover": 70.0, "canopy_height": 20.0, "canopy_base_height": 1.0, "canopy_bulk_density": 0.15}
CODE = 165  # TU5


def land(tilt=0.0, **layers):
    """A landscape of 2 worlds of 4 x 5 cells that rises to the east, its planes all of one value."""
    shape = 2, 4, 5
    planes = {name: torch.full(shape, value) for name, value in layers.items()}
    height = torch.arange(5.0).expand(shape) * 30.0 * tilt
    forest = torch.full(shape, 3, dtype=torch.uint8)
    ground = Landscape(cover=forest, age=torch.full_like(forest, 10), elevation=height)
    return ground.with_layers(fuel=torch.full(shape, CODE, dtype=torch.int16), **planes)


def spread(ground, wind=10.0, by_cell=False, **law):
    air = torch.tensor([wind, 0.0]).expand(2, 2)[:, :, None, None]
    moisture = moisture_row({}).expand(2, -1)
    moisture = moisture[:, None, None].expand(-1, 4, 5, -1) if by_cell else moisture
    return RateFire(**law).bed.spread(ground, air, moisture, 30.0)


def same(one, other):
    return all(torch.equal(getattr(one, each.name), getattr(other, each.name)) for each in fields(Spread))


def test_fires_run_in_crowns_as_users_are_told():
    found = spread(land(**TREES), foliar_moisture=80.0)
    canopy = {name.removeprefix("canopy_"): value for name, value in TREES.items()} | {"foliar_moisture": 80.0}
    water = {name: MOISTURES[name] for name in list(MOISTURES)[:5]}
    told = rate_of_spread(CODE, wind=(10.0, 270.0), moisture=water, canopy=canopy)
    assert (found.kind == 2.0).all() and told.kind == 2.0
    for each in fields(Spread):
        expected = getattr(told, each.name).expand(2, 4, 5)
        torch.testing.assert_close(getattr(found, each.name), expected, rtol=1e-5, atol=1e-4)


def test_moisture_may_differ_by_place():
    one, other = (spread(land(**TREES), by_cell=by_cell) for by_cell in (False, True))
    for each in fields(Spread):
        torch.testing.assert_close(getattr(one, each.name), getattr(other, each.name))


def test_a_crown_fire_up_a_slope_goes_less_far_on_the_map():
    # Up a slope of 45 degrees the wind along it is 2^0.5 as fast, the rate 2^0.45, and the way on the map 2^-0.5.
    found = spread(land(tilt=1.0, **TREES))
    assert float((found.head / spread(land(**TREES)).head)[0, 2, 2]) == pytest.approx(2**-0.05, rel=1e-4)


@pytest.mark.parametrize("name", ["canopy_base_height", "canopy_bulk_density"])
def test_without_all_layers_or_without_the_rule_fires_are_of_the_surface_to_the_bit(name):
    surface = spread(land(**{each: TREES[each] for each in ("canopy_cover", "canopy_height")}))
    assert same(spread(land(**TREES), crown="none"), surface) and (surface.kind == 0.0).all()
    assert same(spread(land(**{each: TREES[each] for each in TREES if each != name})), surface)
    assert same(spread(land(**{**TREES, "canopy_bulk_density": 0.0})), surface)


def test_a_gain_lights_crowns_and_acts_on_their_rate():
    calm, base = 5.0, {**TREES, "canopy_base_height": 2.0}
    assert (spread(land(**base), calm).kind == 0.0).all() and (spread(land(**base), calm, rate_gain=2.0).kind > 0).all()
    one, twice = spread(land(**TREES)), spread(land(**TREES), rate_gain=2.0)
    torch.testing.assert_close(twice.head, 2.0 * one.head)
    torch.testing.assert_close(twice.flame_length, 2.0**0.46 * one.flame_length)


def test_wet_needles_do_not_burn():
    kinds = [float(spread(land(**TREES), 5.0, foliar_moisture=water).kind.unique()) for water in (100.0, 180.0)]
    assert kinds == [2.0, 0.0]


def test_the_rule_of_rothermel_is_another():
    assert (spread(land(**TREES), crown="rothermel").head != spread(land(**TREES)).head).all()


def test_canadian_rates_have_their_own_crowns():
    bed = RateFire(model="fbp").bed
    assert not bed.runs_in_crowns(land(**TREES)) and bed.lack_of_canopy(land()) is None
    assert RateFire().bed.runs_in_crowns(land(**TREES)) and not RateFire(crown="none").bed.runs_in_crowns(land(**TREES))


def test_what_a_map_lacks_is_told():
    assert lack_of_canopy(land()) == RateFire().bed.lack_of_canopy(land())
    assert "no canopy cover is read" in lack_of_canopy(land())
    assert "no canopy base height and bulk density" in lack_of_canopy(land(canopy_cover=70.0, canopy_height=20.0))
    assert lack_of_canopy(land(canopy_cover=10.0, canopy_height=20.0)) is None, "too open for crown fire"
    assert lack_of_canopy(land(**TREES)) is None


def test_the_law_refuses_what_it_does_not_know():
    with pytest.raises(ValueError, match=r"^crown must be cruz"):
        RateFire(crown="finney")
    with pytest.raises(ValueError, match=r"^foliar_moisture must be in \[20, 400\]"):
        RateFire(foliar_moisture=0.9)
