"""The maps of a prediction as files."""

import pytest
import torch

from tests.prediction.test_predict import UNEVEN, run
from warp_torchrl.prediction.files import layers, panels


@pytest.fixture(scope="module")
def prediction():
    return run(270.0, fire=UNEVEN, fires=7)


def test_bands_of_times_are_in_hours_and_in_their_order(prediction):
    bands = layers(prediction)["arrival_hours"]
    minutes = {"median": "arrival_minutes", "early_10": "arrival_early", "late_90": "arrival_late"}
    for band, field in minutes.items():
        assert torch.allclose(bands[band] * 60.0, getattr(prediction, field), equal_nan=True), band
    came = ~bands["median"].isnan()
    early, median, late = (bands[band][came] for band in ("early_10", "median", "late_90"))
    assert (early <= median).all() and (median <= late).all() and (early < late).any()


def test_colours_end_at_the_99th_percentile_and_what_no_fire_reached_has_none(prediction):
    chance, arrival, rate, *_ = panels(prediction)
    assert torch.equal(chance.values.isnan(), prediction.burn_probability == 0.0)
    assert torch.allclose(arrival.values * 60.0, prediction.arrival_minutes, equal_nan=True)
    known = prediction.rate[~prediction.rate.isnan()]
    assert rate.top == pytest.approx(float(known.quantile(0.99)))
