"""Fuels by Anderson's numbers."""

from tests.world.drawing import draw
from warp_torchrl.world.behaviour.fuel_codes import FBP_CODES
from warp_torchrl.world.behaviour.standard_fuels import anderson_13, scott_burgan_40
from warp_torchrl.world.law.anderson import anderson_numbers, numbers_of
from warp_torchrl.world.law.fire import Fire


def test_every_fuel_that_burns_has_a_number():
    for model, table in (("fbfm13", anderson_13()), ("fbfm40", scott_burgan_40())):
        burns = table.fuels.load[:-1].sum(-1) > 0.0
        assert all(numbers_of(model)[code] for code in table.codes[burns].tolist()), model
    lacking = [code for code in FBP_CODES.tolist() if not numbers_of("fbp")[code]]
    assert lacking == [0, 99, *range(100, 107)], "those that do not burn"


def test_ground_of_an_unknown_fuel_has_that_of_its_cover():
    state = draw("TT TT", ground="gf wb")
    grass, forest, wetland, bare = anderson_numbers(Fire(), state.landscape).flatten().tolist()
    assert (grass, forest, wetland, bare) == (1, 10, 8, 0)
