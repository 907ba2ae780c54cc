"""What the heads and the rears of fires do that burn alone."""

import pytest
import torch

from warp_torchrl.world.air.fields import Lattice, WeatherFields
from warp_torchrl.world.air.sunlight import Sunlight
from warp_torchrl.world.behaviour.spread import Spread
from warp_torchrl.world.fires.spell import Spell, air_in, heads, spread_in
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.state.state import Landscape
from warp_torchrl.world.state.window import Window
from warp_torchrl.world.weather.fosberg import correction


@pytest.mark.parametrize(("ratio", "rear"), [(2.0, 0.718), (1.0, 10.0)], ids=["an ellipse", "a round fire has no rear"])
def test_the_rear_goes_slower_by_the_eccentricity(ratio, rear):
    # Of length to breadth 2, e^2 = 3 / 4: 10 (1 - e) / (1 + e) = 0.718
    cell = torch.ones(1, 1, 1)
    spread = Spread(
        head=10.0 * cell,
        direction=0.0 * cell,
        length_to_breadth=ratio * cell,
        intensity=3000.0 * cell,
        flame_length=2.0 * cell,
        kind=cell,
    )
    assert heads(spread).flatten().tolist() == pytest.approx([10.0, rear, 3000.0, 2.0], abs=1e-3)
    assert heads(spread, with_kind=True).flatten().tolist()[4:] == [1.0]


def test_steep_ground_in_the_sun_is_drier_and_a_window_has_what_the_map_has():
    rows, level = torch.arange(40.0)[:, None].expand(40, 30), torch.full((1, 40, 30), 102, dtype=torch.int16)
    cover = torch.full((1, 40, 30), 2, dtype=torch.uint8)
    ridge = Landscape(cover=cover, age=torch.full_like(cover, 10), elevation=(-20.0 * (rows - 20.0).abs())[None])
    fine = 5.0 + correction(8, 14.5)
    sunlight = Sunlight(fine, fine[0].mean())  # north 8, south 6, on a slope of 2 in 3
    moisture = torch.tensor([float(sunlight.level), 7.0, 8.0, 60.0, 90.0, 90.0, 60.0])
    spell = Spell(torch.tensor([0.01, 0.0]), 60.0, moisture, sunlight=sunlight)
    law, ground = RateFire(model="fbfm40", slope_gain=0.0), ridge.with_layers(fuel=level)
    head = spread_in(law, ground, 30.0, spell).head[0]
    told = []
    for fine in (8.0, 6.0):
        damp = torch.tensor([fine, fine + 1.0, fine + 2.0, 60.0, 90.0, 90.0, 60.0])
        told.append(spread_in(law, ground, 30.0, Spell(spell.wind, 60.0, damp)))
    assert float(head[8, 9]) == pytest.approx(float(told[0].head[0, 8, 9]), rel=1e-4)
    assert float(head[32, 9]) == pytest.approx(float(told[1].head[0, 32, 9]), rel=1e-4) and head[32, 9] > head[8, 9]
    window = Window(5, 4, 20, 16, (40, 30))
    assert torch.equal(spread_in(law, ground, 30.0, spell, window).head[0], head[5:25, 4:20])
    moist = air_in(law, ground, spell, window, 30.0)[1]
    assert moist[0, 3, 5].tolist() == pytest.approx([8.0, 9.0, 10.0, 60.0, 90.0, 90.0, 60.0])


def test_a_slope_departs_from_the_level_ground_of_its_place_where_no_rain_falls():
    rows = torch.arange(20.0)[:, None].expand(20, 17)
    cover = torch.full((1, 20, 17), 2, dtype=torch.uint8)
    slope = Landscape(cover=cover, age=torch.full_like(cover, 10), elevation=(20.0 * rows)[None])  # falls to the north
    ground = slope.with_layers(fuel=torch.full((1, 20, 17), 102, dtype=torch.int16))
    level = torch.tensor([[4.0, 8.0]] * 2)
    for east_level, dry, told in ((8.0, 1.0, [6.0, 8.0, 10.0]), (35.0, 0.0, [6.0, 20.5, 35.0])):
        # Steep ground to the north has 2 more than level ground, which has 4 in the west; half of it half-way to rain.
        level[:, 1] = east_level
        mean = level.mean()
        fields = WeatherFields(
            Lattice((0.0, 19.0), (0.0, 16.0)),
            torch.ones(1, 2, 2, 2),
            torch.cat((torch.stack((level, level + 1.0, level + 2.0)), torch.full((4, 2, 2), torch.nan)))[None],
        )
        fine = mean + torch.stack((torch.zeros(4), torch.tensor([2.0, 1.0, 0.0, 0.0]), torch.full((4,), 3.0)))
        sunlight = Sunlight(fine, mean, dry=torch.tensor([[1.0, dry]] * 2))
        row = torch.tensor([float(mean), float(mean) + 1.0, float(mean) + 2.0, 60.0, 90.0, 90.0, 60.0])
        spell = Spell(torch.tensor([0.01, 0.0]), 60.0, row, field=fields.at(0), sunlight=sunlight)
        law = RateFire(model="fbfm40", slope_gain=0.0)
        moist = air_in(law, ground, spell, Window.whole((20, 17)), 30.0)[1]
        assert moist[0, 9, [0, 8, 16], 0].tolist() == pytest.approx(told)
        assert moist[0, 9, [0, 8, 16], 2].tolist() == pytest.approx([each + 2.0 for each in told])
        head = spread_in(law, ground, 30.0, spell).head[0]
        window = Window(5, 4, 10, 8, (20, 17))
        assert torch.equal(spread_in(law, ground, 30.0, spell, window).head[0], head[5:15, 4:12])
        assert head[9, 0] > head[9, 8] >= head[9, 16]
