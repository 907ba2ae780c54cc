"""Twin experiments: what three observations of a hidden fire teach."""

import math

import pytest
import torch

from tests.prediction.observed.twins import perimeters, scene, truth
from warp_torchrl.prediction.observed.correction import FORECASTS, Correction
from warp_torchrl.prediction.observed.observation import Observation
from warp_torchrl.world.fires.members import Deviations
from warp_torchrl.world.fires.sightings import HotSpotSensor

TIMES = (25.0, 45.0, 65.0, 85.0)
UNKNOWN = Deviations(wind_speed=0.0, moisture=0.0)


def corrected(rate, turn, number, *, times=TIMES, deviations=UNKNOWN, members=64, side=51):
    fire = scene(side, number)
    seen = perimeters(truth(fire, rate, turn, number, times[-1]), *times)
    return Correction(members=members, deviations=deviations, seed=1000 * number)(fire, seen)


@pytest.fixture(scope="module")
def learned():
    return corrected(1.7, 30.0, 0)


def test_after_three_observations_the_rate_is_known_and_the_forecast_is_better(learned):
    third, last = learned.steps[2], learned.steps[3]
    assert third.posterior["rate"][2] == pytest.approx(1.7, rel=0.2)
    assert third.posterior["bearing"][2] == pytest.approx(30.0, abs=12.0)
    scores = last.scores
    assert tuple(scores) == FORECASTS
    assert scores["corrected"].crps <= 0.6 * scores["free"].crps
    assert scores["corrected"].brier < scores["members"].brier < 1.0 and scores["persistence"].brier == 1.0
    assert scores["corrected"].growth_jaccard > scores["restart"].growth_jaccard


def test_before_anything_is_seen_all_forecasts_of_members_are_one(learned):
    first = learned.steps[0].scores
    assert first["free"] == first["members"] == first["corrected"]


def test_members_of_equal_weight_stand_for_the_weighted_ones(learned):
    found = learned.equal_members(0)
    assert len(found) == 64
    assert float(found.rate.median()) == pytest.approx(learned.steps[-1].posterior["rate"][2], rel=0.1)


def test_the_same_seed_learns_the_same():
    one, other = (corrected(1.7, 30.0, 0, times=TIMES[:2], members=8, side=31) for _ in range(2))
    assert torch.equal(one.members.values, other.members.values) and one.steps[1].scores == other.steps[1].scores


def test_hot_spots_teach_the_rate():
    fire = scene(61, 3)
    arrival = truth(fire, 1.6, 0.0, 3, 100.0)
    sensor = HotSpotSensor(pixel=100.0, detection=0.8, false_alarm=0.001)
    draws = torch.Generator().manual_seed(0)
    seen = [
        Observation(
            minutes=each,
            kind="hot_spots",
            cells=(arrival <= each) & (torch.rand(arrival.shape, generator=draws) < 0.5),
        )
        for each in (40.0, 70.0, 100.0)
    ]
    found = Correction(members=32, deviations=UNKNOWN, sensor=sensor)(fire, seen)
    assert found.steps[-1].posterior["rate"][2] == pytest.approx(1.6, rel=0.3)
    last = found.steps[-1].scores
    assert last["corrected"].brier < last["free"].brier and last["corrected"].growth_jaccard > 0.5


def test_lone_hot_spots_apart_from_the_fire_are_false_alarms():
    known, cells = (torch.zeros(60, 60, dtype=torch.bool) for _ in range(2))
    known[30, 30] = True
    cells[30, 36] = cells[5, 5] = True
    cells[50, [40, 46, 52]] = True
    burned = Observation(minutes=1.0, kind="hot_spots", cells=cells).burned(known, HotSpotSensor(), 5)
    assert bool(burned[30, 30] & burned[30, 36] & burned[50, 46] & burned[50, 49]) and not bool(burned[5, 5])
    assert int(burned[:, :20].sum()) == 0


@pytest.mark.slow
def test_rates_of_half_to_twice_and_a_turned_wind_are_found():
    # 11 of 12 were within 20 % when this was written, 9 with 100 members: of a chance of 0.9, under 10 come in 1 of 9
    within, better = 0, 0
    for number, share in enumerate(torch.linspace(-1.0, 1.0, 12).tolist()):
        rate = 2.0**share
        found = corrected(rate, 30.0 * (-1) ** number, number, times=(40.0, 70.0, 100.0, 130.0), members=300, side=71)
        within += abs(found.steps[2].posterior["rate"][2] / rate - 1.0) <= 0.2
        scores = found.steps[3].scores
        better += scores["corrected"].crps <= 0.6 * scores["free"].crps
    assert within >= 10 and better >= 11


@pytest.mark.slow
def test_the_rate_is_inside_its_interval_nine_times_of_ten():
    # 40 fires whose rate and wind are drawn from what members are: 90 % are 36; fewer than 30 has a chance of 1 %
    inside, draws = 0, torch.Generator().manual_seed(5)
    for number in range(40):
        scale = UNKNOWN.scales * torch.randn(4, generator=draws)
        rate = math.exp(float(scale[0]))
        found = corrected(rate, float(scale[2]), number, times=(40.0, 70.0, 100.0), members=100, side=71)
        low, *_, high = found.steps[-1].posterior["rate"]
        inside += low <= rate <= high
    assert inside >= 30
