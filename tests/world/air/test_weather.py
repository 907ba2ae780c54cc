"""Weather by the hour as the wind of a run."""

import pytest
import torch

from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError, build
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.world.state.state import Landscape

LEVEL = torch.zeros(1, 1, 1, dtype=torch.uint8)


def test_units_that_a_file_does_not_state_are_keys_of_the_wind(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("WindSpeed,WD\n36,270\n")
    given = ["wind=weather", f"wind.path={path}", "wind.minutes_per_tick=5"]
    with pytest.raises(ConfigError, match="WindSpeed must name its unit"):
        build(plain(compose_config("train", given))["wind"], "wind")
    wind = build(plain(compose_config("train", [*given, "wind.units.wind_speed=km/h"]))["wind"], "wind")
    speed, _ = next(wind.hours(torch.zeros(1, dtype=torch.int64), Landscape(LEVEL, LEVEL, None)))
    assert speed.flatten().tolist() == pytest.approx([10.0, 0.0], abs=1e-5)
