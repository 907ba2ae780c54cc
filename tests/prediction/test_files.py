"""The maps of a prediction as files."""

import pytest
import torch

from tests.prediction.test_predict import UNEVEN, ground, lit, run
from warp_torchrl.prediction.files import layers, panels
from warp_torchrl.prediction.predict import predict
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.weather.table import WeatherTable


@pytest.fixture(scope="module")
def prediction():
    return run(270.0, fire=UNEVEN, fires=7)


def test_bands_of_times_are_in_hours_and_in_their_order(prediction):
    bands = dict(layers(prediction))["arrival_hours"]
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


def test_fires_in_crowns_are_counted_where_the_ground_knows_its_crowns(prediction):
    assert not prediction.has_crowns and "crown" not in dict(layers(prediction)) and len(panels(prediction)) == 5
    trees = {"canopy_cover": 70.0, "canopy_height": 20.0, "canopy_base_height": 1.0, "canopy_bulk_density": 0.15}
    land = ground(code=165)
    planes = {name: torch.full(land.cover.shape, value) for name, value in trees.items()}
    planes["canopy_cover"][..., 40:] = 40.0  # too open for crown fire
    wind = WeatherTable(wind_speed=torch.tensor([10.0]), wind_bearing=torch.tensor([270.0]), hours=torch.zeros(1))
    found = predict(land.with_layers(**planes), wind, lit(column=5), fire=RateFire(), fires=3, cell_size=50.0, hours=1)
    bands = dict(layers(found))["crown"]
    assert list(bands) == ["crown_fire", "active_crown_fire"] and len(panels(found)) == 6
    came = ~bands["crown_fire"].isnan()
    assert torch.equal(came, (found.burn_probability > 0.0) & ~found.lit)
    assert (bands["crown_fire"][:, :40][came[:, :40]] == 1.0).all() and came[:, 40:].any()
    assert (bands["crown_fire"][:, 40:][came[:, 40:]] == 0.0).all()
    assert torch.equal(bands["active_crown_fire"][came], bands["crown_fire"][came]), "in this wind all is active"
    assert found.intensity[:, :40][came[:, :40]].mean() > 20 * found.intensity[:, 40:][came[:, 40:]].mean()
