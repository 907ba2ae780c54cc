"""Fits find the parameters of synthetic fires again, and gradients are those of differences."""

import pytest
import torch

from tests.prediction.calibration.ground import case_of, cases_of, fire
from warp_torchrl.commands import calibrate
from warp_torchrl.prediction.calibration.candidates import burnable, fires_of, median_arrivals
from warp_torchrl.prediction.calibration.evolution import Evolution
from warp_torchrl.prediction.calibration.expected import burning_probability, differentiated, margin
from warp_torchrl.prediction.calibration.fitting import SHARES, check_not_in_weather, folds, score, shrinkage
from warp_torchrl.prediction.calibration.gradients import Gradients
from warp_torchrl.prediction.calibration.options import CalibrationOptions
from warp_torchrl.prediction.calibration.parameters import fire_at, parameters_of
from warp_torchrl.prediction.calibration.report import ScoreLog
from warp_torchrl.prediction.scores.scar import Scores
from warp_torchrl.world.law.travel import NEVER

TRUTH = fire(rate_gain=1.4, wind_gain=0.8)
NAMES = ["rate_gain", "wind_gain"]


@pytest.mark.parametrize(
    "method",
    [
        pytest.param(Gradients(prior_weight=1e-4, softness=0.1, steps=4), marks=pytest.mark.slow),
        pytest.param(Evolution(generations=10, prior_weight=1e-4), marks=pytest.mark.slow),
    ],
    ids=["g", "e"],
)
def test_known_parameters_are_found_again(method):
    if isinstance(method, Evolution):
        pytest.importorskip("cma", reason="evolution needs the extra calibration")
    start = fire()
    parameters = parameters_of(NAMES, start)
    law = fire_at(
        start, parameters, method(start, parameters, [case_of(TRUTH, side=31), case_of(TRUTH, (0.5, 2.0), side=31)])
    )
    assert law.rate_gain == pytest.approx(1.4, rel=0.05) and law.wind_gain == pytest.approx(0.8, rel=0.05)


def test_a_strong_prior_keeps_the_law_as_it_was():
    start = fire()
    parameters = parameters_of(NAMES, start)
    z = Gradients(prior_weight=100.0, steps=1)(start, parameters, cases_of(TRUTH)[1:])
    assert z.abs().max() < 0.05


def test_the_prior_of_evolution_adds_its_weight_times_half_of_z_squared():
    # z = (1, -2): half of 1 + 4 is 2.5.
    start = fire()
    parameters, z, case = parameters_of(NAMES, start), torch.tensor([1.0, -2.0]), case_of(TRUTH, side=21)
    candidates = torch.stack((torch.zeros(2), z))
    free, bound = (Evolution(prior_weight=weight) for weight in (0.0, 0.4))
    more = bound.losses(start, parameters, candidates, [case]) - free.losses(start, parameters, candidates, [case])
    assert more.tolist() == pytest.approx([0.0, 1.0], abs=1e-5)


def test_in_weather_that_stays_the_margin_is_the_logarithm_of_the_time():
    start = fire()
    case = case_of(TRUTH, turned=0.0)
    times = median_arrivals([start], case)[0, 0]
    found = margin(start, (), torch.zeros(0), case)
    near = (times > 100.0) & (times < 178.0)
    off = found.log_factor[-1][near] - torch.log(times[near] / 180.0)
    assert off.abs().median() < 0.02 and off.abs().max() < 0.12
    assert ((found.log_factor[-1] <= 0.0) == (times <= 180.0)).all()


def test_the_gradient_is_that_of_finite_differences():
    start = fire()
    case, parameters, move = case_of(TRUTH, side=25), parameters_of(NAMES, start), torch.tensor([0.2, -0.1])
    at = margin(start, parameters, torch.zeros(2), case)

    def burned(z):
        return burning_probability(margin(start, parameters, z, case).log_factor, 0.2).sum()

    density = torch.exp(-0.5 * (at.log_factor / 0.2).square()) / (0.2 * (2 * torch.pi) ** 0.5)
    told = -(density * at.gradient).sum((1, 2, 3))
    difference = (burned(move) - burned(-move)) / 2
    assert torch.allclose(move @ told, difference, rtol=0.1), f"rungs are apart: {told}"


def test_times_go_down_by_their_share_where_all_rates_go_up():
    # In weather that stays t is proportional to 1 / rate, so dt / dx is -t: on the engine's own derivatives
    start = fire()
    case = case_of(TRUTH, side=25, turned=0.0)
    hours = [fires_of([start], case).hour(number) for number in range(len(case.spells))]
    tangents = torch.stack([-hour.travel for hour in hours])
    minutes, slopes = differentiated(hours, tangents, case, burnable(start, case))
    came = minutes < NEVER / 2
    assert came.sum() > 500 and torch.allclose(slopes[0][came], -minutes[came], rtol=1e-3, atol=1e-2)


def test_groups_of_laws_burn_as_each_does_alone():
    laws = [fire(), fire(rate_gain=1.4)]
    case = case_of(TRUTH, side=25)
    both = median_arrivals(laws, case)[:, 0]
    alone = median_arrivals(laws[1:], case)[0, 0]
    assert torch.equal(both[1], alone), "the faster law sets the ticks of both"
    assert (both[0] <= 180.0).sum() < (both[1] <= 180.0).sum()


def test_each_fire_is_left_out_once_and_judges_the_others():
    cases = cases_of(TRUTH)
    assert [(left.name, [each.name for each in others]) for left, others in folds(cases)] == [
        ("east", ["north"]),
        ("north", ["east"]),
    ]


def test_refusals_are_one_line():
    start, cases = fire(), cases_of(TRUTH)
    deviation = parameters_of(["cell_deviation"], start)
    with pytest.raises(ValueError, match="method must be evolution where cell_deviation is fitted"):
        Gradients()(start, deviation, cases)
    with pytest.raises(ValueError, match="loss must be brier or cross_entropy where cell_deviation is fitted"):
        Evolution()(start, deviation, cases)
    with pytest.raises(ValueError, match="loss must be cross_entropy or brier for gradients, got jaccard"):
        Gradients(loss="jaccard")
    with pytest.raises(ValueError, match=r"seed must be in \[1, "):
        Evolution(seed=2**31)
    cases[0].spells[0].moisture[5] = 90.0
    with pytest.raises(ValueError, match=r"moisture\.ffmc is by that of east"):
        check_not_in_weather(parameters_of(["moisture.ffmc"], start), cases)


def scored(*values):
    """Return scores under each share of a fit."""
    return {
        share: Scores(jaccard_at_area=value, sorensen_at_area=0.0, jaccard=value)
        for share, value in zip(SHARES, values, strict=True)
    }


def test_of_shares_of_a_fit_the_best_on_fires_left_out_is_kept_and_of_equal_ones_the_least():
    # Gains of 0.2 and 0.1: their mean is 0.15, their standard deviation 0.1 / sqrt(2), its error 0.05.
    kept = shrinkage([scored(0.5, 0.6, 0.7, 0.6, 0.5), scored(0.5, 0.6, 0.6, 0.5, 0.5)])
    assert (kept.share, kept.gain, kept.error) == pytest.approx((0.5, 0.15, 0.05))
    assert str(kept).endswith("on 2 fires left out its Jaccard index is higher by 0.150 +- 0.050")
    assert shrinkage([scored(0.5, 0.5, 0.5, 0.5, 0.5)]).share == 0.0, "no fit without a gain"


def test_a_fit_that_gains_on_one_fire_and_loses_on_others_is_not_kept():
    # Gains of 0.2, 0 and -0.05: their mean, 0.05, is under its standard error of 0.076.
    kept = shrinkage([scored(0.5, 0.5, 0.5, 0.5, last) for last in (0.7, 0.5, 0.45)])
    assert kept.share == 0.0 and "none is better than no fit" in str(kept)


@pytest.mark.slow
@pytest.mark.parametrize(("truth", "least", "most"), [(1.0, 0.9, 1.1), (2.0, 1.6, 2.4)])
def test_twins_whose_rates_differ_about_a_gain_give_it_back(tmp_path, truth, least, most):
    """Three fires whose own rates are 0.75, 1 and 1.33 times the gain, as fires' rates differ."""
    names = ("slow", "middle", "fast")
    cases = [
        case_of(fire(rate_gain=truth * own), side=31, name=name)
        for name, own in zip(names, (0.75, 1.0, 1.33), strict=True)
    ]
    options = CalibrationOptions(fires=names, parameters=("rate_gain",), draws=8, steps=4)
    start, rows = fire(), ScoreLog(tmp_path / "scores.log", names)
    for case in cases:
        rows.add(case.name, "uncalibrated", score(start, case, options.draws, options.seed))
    law, kept = calibrate._fit(start, parameters_of(options.parameters, start), cases, rows, options)
    assert least < law.rate_gain < most
    assert kept.fires == 3 and (kept.share > 0.0) == (truth > 1.0)
