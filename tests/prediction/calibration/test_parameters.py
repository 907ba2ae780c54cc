"""Parameters: what they are called, where they stand, and what is refused."""

import pytest
import torch

from tests.prediction.calibration.ground import fire
from warp_torchrl.prediction.calibration.parameters import fire_at, parameter, parameters_of

NAMES = ("rate_gain", "slope_gain", "fuel_gain.2", "moisture.bui", "cell_deviation")


def test_at_zero_the_law_is_as_it_was():
    start = fire(rate_gain=1.3, fuel_gain={2: 0.5})
    law = fire_at(start, parameters_of(NAMES, start), torch.zeros(5))
    assert (law.rate_gain, law.fuel_gain[2], law.moisture["bui"]) == pytest.approx((1.3, 0.5, 60.0))
    assert law.moisture["ffmc"] == 86.0


@pytest.mark.parametrize(
    ("name", "usual"),
    [
        ("rate_gain", (0.2, 5.0, 0.3)),
        ("fuel_gain.2", (0.2, 5.0, 0.3)),
        ("moisture.ffmc", (50.0, 100.0, 3.0)),
        ("moisture.bui", (1.0, 300.0, 20.0)),
        ("moisture.dead_1h", (1.0, 60.0, 2.0)),
        ("moisture.live_herbaceous", (30.0, 300.0, 30.0)),
        ("moisture.live_woody", (30.0, 300.0, 30.0)),
        ("cell_deviation", (0.02, 1.0, 0.5)),
    ],
)
def test_bounds_and_priors_are_those_of_the_docs(name, usual):
    made = parameter(name)
    assert (made.low, made.high, made.scale) == usual


def test_gains_move_by_their_logarithm_and_moistures_by_their_value():
    start = fire()
    law = fire_at(start, parameters_of(NAMES, start), torch.tensor([1.0, -1.0, 2.0, -0.5, 0.0]))
    assert law.rate_gain == pytest.approx(2.718282**0.3) and law.slope_gain == pytest.approx(2.718282**-0.3)
    assert law.fuel_gain[2] == pytest.approx(2.718282**0.6) and law.moisture["bui"] == pytest.approx(50.0)


def test_values_stay_inside_the_bounds_and_limits_reach_them():
    start = fire()
    made = parameters_of(["rate_gain"], start, {"rate_gain": [0.5, 1.5]}, {"rate_gain": 0.1})
    assert made[0].value(1.0, 99.0) == 1.5 and made[0].value(1.0, made[0].limits(1.0)[0]) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("names", "options", "line"),
    [
        (["rat_gain"], {}, "did you mean rate_gain"),
        (["fuel_gain.grass"], {}, "parameters must be of"),
        (["moisture.dead"], {}, "parameters must be of"),
        (["rate_gain", "rate_gain"], {}, "parameters must each be named once"),
        (
            ["rate_gain"],
            {"bounds": {"wind_gain": [1, 2]}},
            "bounds must name parameters that are fitted, got wind_gain",
        ),
        (["rate_gain"], {"bounds": {"rate_gain": [2, 3]}}, r"fire.rate_gain must be in its bounds, \[2, 3\], got 1"),
        (["rate_gain"], {"bounds": {"rate_gain": [0, 3]}}, "bounds.rate_gain must be over 0"),
        (["rate_gain"], {"scales": {"rate_gain": 0}}, "scales.rate_gain must be over 0, got 0"),
        (["rate_gain"], {"scales": {"rate_gain": [1]}}, r"scales.rate_gain must be a finite number, got \[1\]"),
        (["rate_gain"], {"bounds": {"rate_gain": 1}}, "bounds.rate_gain must be a pair from low to high, got 1"),
        (["rate_gain"], {"bounds": {"rate_gain": "12"}}, "bounds.rate_gain must be a pair from low to high, got '12'"),
        (["rate_gain"], {"bounds": {"rate_gain": [0.5, True]}}, "bounds.rate_gain must be a finite number, got True"),
        (["rate_gain"], {"bounds": {"rate_gain": [0.5, 1e400]}}, "bounds.rate_gain must be a finite number, got inf"),
    ],
)
def test_a_refusal_is_one_line(names, options, line):
    with pytest.raises(ValueError, match=line) as error:
        parameters_of(names, fire(), **options)
    assert "\n" not in str(error.value)
