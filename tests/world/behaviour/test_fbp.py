"""The Canadian fire behaviour prediction system: its published examples, and laws."""

import math
from dataclasses import fields

import pytest
import torch

from warp_torchrl.world.behaviour.fbp import fbp_spread, foliar_moisture, surface_consumption
from warp_torchrl.world.behaviour.fbp_fuels import curing_effect, fbp_fuels

# The standard test data of the system (Wotton, Alexander and Taylor 2009, GLC-X-10). Inputs: the data set test_fbp of
# the R package cffdrs; outputs: what that package gives for them (its file FireBehaviourPrediction_test_fbp.csv).
# Code, FFMC, BUI, wind [km/h], bearing, slope [per cent], aspect, needles' water [per cent], per cent of conifer or
# fir, grass load, curing | rate [m/min], direction, length to breadth, intensity [kW/m]
EXAMPLES = """
 1 90   130 20   0   15 270  93.3349 50 .35 80 | 5.56890323 174.695823 2.58137464   3147.81700
 2 97   119 20.4 0   75 315 107.3872 50 .35 80 | 121.103755 141.486358 9.32604158 164491.28097
 3 95    30 50   0    0 180  93.3349 50 .35 80 | 80.5171365 180.000000 6.06599780  42314.89284
 4 85    82 0    0   75 315  94.1476 50 .35 80 | 16.6568192 135.000000 4.20741208  18512.25164
 5 88    56 3.4  0   23 180  85.9261 50 .35 80 | 0.04891883   0.000000 1.00000003     17.87703
 6 94    56 25   0   10 180  92.5600 50 .35 80 | 42.8087391 180.000000 2.93896405  36704.87490
 7 88.8  15 22.1 270 15   0  89.8384 50 .35 80 | 2.35774365  99.820973 2.87441267   1490.58859
11 98   100 50   270 35   0   0.0000 50 .35 80 | 31.2118068 107.495277 6.28858515  11792.25430
40 90    40 15.5 180 25 180 108.5700 55 .35 80 | 13.3071943   0.000000 3.16939621   6817.05346
50 97   150 41   180 50 200 118.7048 10 .35 80 | 18.0574768   7.660082 7.31201479   9474.79871
70 87    25 10.7 180  8 273 112.7252 70 .35 80 | 9.36613067  13.306666 1.55346872   4010.23969
80 97    80 35   180 50 270 120.0000 30 .35 80 | 36.0984971  43.979964 5.93625323  35166.49816
31 95    20 35   180 50 270   0.0000 50 1.0 90 | 134.693261  40.713285 6.51145787  40407.97831
32 85    40 0.5  180  0 179   0.0000 50 0.2 55 | 0.40237628   0.000000 1.00000000     24.14258
32 95    40 35   180 10 270   0.0000 50 1.0 45 | 13.2986361   5.028015 5.73610617   3989.59083
21 95   130 15   180 20 225   0.0000 50 .35 80 | 45.1105067  16.888874 2.88475395 105514.82262
22 87    63 0    0    0 180   0.0000 50 .35 80 | 1.01230237 180.000000 1.00000000   3478.57690
23 89    20 0    0   30 270   0.0000 50 .35 80 | 1.39909522  90.000000 1.19245239   4301.88862
 6 90    80 15   0   10 270  96.8125 50 .35 80 | 4.39541967 173.255848 1.99102287   2687.57484
 6 91   100 20   0   30 270 120.0000 50 .35 80 | 17.6370032 160.575377 2.72084765  20766.52487
"""
EVERY_CODE = torch.tensor([1, 2, 3, 4, 5, 6, 7, 11, 12, 21, 22, 23, 31, 32, 40, 50, 70, 80])
LEVEL = {"wind_bearing": 0.0, "slope": 0.0, "aspect": 0.0, "bui": 60.0}


def spread(code, **changed):
    weather = {**LEVEL, "wind_speed": 4.0, "ffmc": 90.0, **changed}
    return fbp_spread(torch.as_tensor(code) if isinstance(code, int | float) else code, **weather)


def test_crowns_of_c6_do_not_burn_where_they_would_slow_the_head():
    # FFMC 95: 5.7165 per cent, f(F) = 41.62; 25 km/h: an index of 30.51. On the surface 30 (1 - e^-2.441)^3 = 22.83
    # m/min at a buildup index of 62, where its effect is 1; 5 (1 - e^-0.9238)^2.48 = 1.426 kg/m2 burn, and crowns from
    # 0.001 (7 * 4345)^1.5 / (300 * 1.426) = 12.4 m/min on. With needles of 150 per cent they go 60 (1 - e^-1.516)
    # 1.0875^4 1000 / 4345 / 0.778 = 19.4 m/min: no gain, so that eq. 58 is not asked, and 300 * 1.426 * 22.83 kW/m
    head = spread(6, ffmc=95.0, wind_speed=25 / 3.6, bui=62.0, foliar_moisture=150.0)
    assert head.head.item() == pytest.approx(22.83, rel=1e-3)
    assert head.intensity.item() == pytest.approx(9765, rel=1e-3)
    drier = spread(6, ffmc=95.0, wind_speed=25 / 3.6, bui=62.0, foliar_moisture=97.0)
    assert drier.head > head.head and drier.intensity > 2 * head.intensity


def test_it_gives_the_published_examples():
    rows = [line.replace("|", " ").split() for line in EXAMPLES.split("\n") if line.strip()]
    table = torch.tensor([[float(word) for word in row] for row in rows], dtype=torch.float64).T
    code, ffmc, bui, wind, bearing, grade, aspect, needles, percent, load, cured, *told = table
    told = torch.stack(told).float()
    head = fbp_spread(
        code.long(),
        wind_speed=wind / 3.6,
        wind_bearing=bearing,
        slope=torch.rad2deg(torch.atan(grade / 100)),
        aspect=aspect,
        ffmc=ffmc,
        bui=bui,
        curing=cured,
        percent_conifer=percent,
        percent_dead_fir=percent,
        grass_load=load,
        foliar_moisture=needles,
    )
    assert torch.allclose(head.head, told[0], rtol=2e-5)
    turned = (head.direction - told[1] + 180) % 360 - 180
    assert turned.abs().max() < 0.01
    assert torch.allclose(head.length_to_breadth, told[2], rtol=2e-5)
    assert torch.allclose(head.intensity, told[3], rtol=2e-5)
    assert torch.allclose(head.flame_length, 0.0775 * told[3] ** 0.46, rtol=2e-5)
    assert all(getattr(head, each.name).dtype == torch.float32 for each in fields(head))


def test_d2_is_a_fifth_of_d1_where_the_duff_is_dry():
    aspen = torch.tensor([11, 12])
    moist, dry = (spread(aspen, bui=bui) for bui in (79.0, 80.0))
    assert moist.head[1] == 0 and moist.intensity[1] == 0 and moist.length_to_breadth[1] > 1
    assert dry.head[1].item() == pytest.approx(0.2 * dry.head[0].item(), rel=1e-6)


@pytest.mark.parametrize("code", [0, 99, 101, 102, 105, 8, 10, 14, 33, 61, -9999, 1000, 30000])
def test_what_is_no_fuel_does_not_burn(code):
    head = spread(code)
    assert (head.head, head.length_to_breadth, head.intensity, head.flame_length) == (0, 1, 0, 0)


@pytest.mark.parametrize(
    ("code", "same", "told"),
    [(425, 40, 25.0), (575, 50, 75.0), (625, 40, 25.0), (730, 70, 30.0), (805, 80, 5.0), (995, 70, 95.0)],
)
def test_the_last_digits_of_a_graded_code_are_the_per_cent(code, same, told):
    stated = spread(same, percent_conifer=told, percent_dead_fir=told)
    assert spread(code, percent_conifer=1.0, percent_dead_fir=1.0).head == stated.head


@pytest.mark.parametrize(("code", "leafless", "green"), [(13, 11, 12), (60, 40, 50), (90, 70, 80), (630, 430, 530)])
def test_leaves_decide_what_fuels_of_two_seasons_are(code, leafless, green):
    assert spread(code, bui=100.0).head == spread(leafless, bui=100.0).head
    assert spread(code, bui=100.0, green=True).head == spread(green, bui=100.0).head
    assert spread(leafless, bui=100.0, green=True).head == spread(leafless, bui=100.0).head


def test_a_mixed_forest_of_conifers_alone_starts_as_fast_as_spruce():
    # At the buildup index where the effect is 1, which is 64 in C-2 and 50 in M-1
    assert spread(40, percent_conifer=100.0, bui=50.0).head == pytest.approx(spread(2, bui=64.0).head.item(), rel=1e-6)
    assert spread(40, percent_conifer=0.0, bui=50.0).head == pytest.approx(spread(11, bui=32.0).head.item(), rel=1e-6)


def test_grass_spreads_by_its_curing():
    # GLC-X-10 eq. 35a at 50 per cent: 0.005 (e^3.05 - 1) = 0.1006; eq. 35b at 80: 0.176 + 0.02 * 21.2 = 0.6, at 100: 1
    assert curing_effect(torch.tensor([50.0, 80.0, 100.0])).tolist() == pytest.approx([0.100577, 0.6, 1.0], rel=1e-4)
    assert (spread(31, curing=100.0).head / spread(31).head).item() == pytest.approx(1 / 0.6, rel=1e-5)


def test_more_wind_drier_fuel_and_steeper_ground_make_every_fuel_faster():
    for name, values in {"wind_speed": (2.0, 4.0), "ffmc": (85.0, 92.0), "bui": (81.0, 120.0)}.items():
        slow, fast = (spread(EVERY_CODE, **{"bui": 90.0, name: value}).head for value in values)
        grassy = torch.tensor([code in (31, 32) for code in EVERY_CODE.tolist()])
        assert ((fast > slow) | (grassy & (name == "bui"))).all(), name
    # The wind comes from the north, so the head goes south: it climbs where downhill is north
    assert (spread(EVERY_CODE, bui=90.0, slope=20.0).head > spread(EVERY_CODE, bui=90.0).head).all()
    assert (spread(EVERY_CODE, bui=90.0, slope=5.0, aspect=180.0).head < spread(EVERY_CODE, bui=90.0).head).all()


def test_the_head_turns_with_wind_and_slope():
    plain = spread(EVERY_CODE, slope=15.0, aspect=30.0)
    turned = spread(EVERY_CODE, slope=15.0, aspect=120.0, wind_bearing=90.0)
    assert torch.allclose((turned.direction - plain.direction) % 360, torch.tensor(90.0), atol=1e-3)
    assert torch.allclose(turned.head, plain.head, rtol=1e-5)


def test_in_calm_on_level_ground_fire_spreads_round():
    head = spread(EVERY_CODE, wind_speed=0.0, wind_bearing=100.0)
    assert torch.allclose(head.length_to_breadth, torch.tensor(1.0)) and torch.allclose(
        head.direction, torch.tensor(280.0)
    )


def test_slopes_past_seventy_per_cent_count_as_that():
    steep = math.degrees(math.atan(0.7))
    at, past = (spread(EVERY_CODE, wind_speed=0.0, slope=slope).head for slope in (steep + 1e-4, 60.0))
    assert torch.allclose(at, past)
    # exp(3.533 * 0.7^1.2) is 10.0: no jump
    assert torch.allclose(spread(EVERY_CODE, wind_speed=0.0, slope=steep - 0.01).head, at, rtol=5e-3)


@pytest.mark.parametrize("wind", [0.0, 4.0, 30.0])
@pytest.mark.parametrize("slope", [0.0, 12.0, 50.0])
@pytest.mark.parametrize("ffmc", [0.0, 70.0, 84.0, 101.0])
def test_every_gradient_is_finite(wind, slope, ffmc):
    inputs = {"wind_speed": wind, "slope": slope, "ffmc": ffmc}
    inputs = {name: torch.tensor([value], requires_grad=True) for name, value in inputs.items()}
    inputs["bui"] = torch.tensor([[0.0], [60.0]], requires_grad=True)
    codes = torch.cat([EVERY_CODE, torch.tensor([101])])
    head = fbp_spread(codes, wind_bearing=10.0, aspect=40.0, **inputs)
    total = sum(getattr(head, each.name).sum() for each in fields(head))
    gradients = torch.autograd.grad(total, tuple(inputs.values()))
    assert total.isfinite() and all(each.isfinite().all() for each in gradients)


def test_gradients_are_those_of_small_differences():
    ffmc = torch.tensor(88.0, requires_grad=True)
    (slope,) = torch.autograd.grad(spread(2, ffmc=ffmc).head, ffmc)
    difference = (spread(2, ffmc=88.1).head - spread(2, ffmc=87.9).head) / 0.2
    assert slope.item() == pytest.approx(difference.item(), rel=1e-2)


def test_maps_and_worlds_broadcast():
    ground = EVERY_CODE.view(3, 6)
    head = spread(ground, wind_speed=torch.tensor([2.0, 4.0]).view(2, 1, 1))
    assert all(getattr(head, each.name).shape == (2, 3, 6) for each in fields(head))
    assert torch.equal(head.head[1], spread(ground).head)
    assert torch.equal(spread(fbp_fuels(ground)).head, spread(ground).head)


def test_needles_are_driest_in_spring():
    # ST-X-3 eqs. 1 to 8; the package's standard data has 93.3349 at 55 N, 110 W on day 182 and 94.1476 at 55 N, 105 W,
    # 200 m on that day, and 108.57 at 47 N, 85 W; 120 past day 50 after the lowest
    assert foliar_moisture(55.0, -110.0, 182).item() == pytest.approx(93.3349, abs=1e-3)
    assert foliar_moisture(55.0, -105.0, 182, elevation=200.0).item() == pytest.approx(94.1476, abs=1e-3)
    assert foliar_moisture(47.0, -85.0, 182).item() == pytest.approx(108.57, abs=1e-3)
    assert foliar_moisture(56.0, -90.0, 258).item() == 120


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"curing": 101.0}, "curing must be in [0, 100], got 101.0"),
        ({"percent_conifer": torch.tensor([-1.0, 50.0])}, "percent_conifer must be in [0, 100], got -1 to 50"),
        ({"percent_dead_fir": float("nan")}, "percent_dead_fir must be in [0, 100], got nan"),
        ({"grass_load": -0.1}, "grass_load must be in [0, 100], got -0.1"),
    ],
)
def test_a_bad_state_of_the_fuel_is_refused(changed, words):
    with pytest.raises(ValueError) as refusal:
        spread(31, **changed)
    assert str(refusal.value) == words


def test_codes_that_are_not_whole_numbers_are_refused():
    with pytest.raises(ValueError, match="fuel must be codes of an integer dtype, got float32"):
        spread(2.0)


def test_crowns_of_c6_burn_only_where_they_carry_the_fire_faster():
    # Eq. 62: crowns spread by foliar moisture, the surface by the buildup index. Wet needles leave them slower than the
    # surface, whose fire would reach them (4 m/min would do): they do not burn, and give no heat.
    values = {"wind_speed": 25.0, "ffmc": 95.0, "bui": 120.0}
    wet, dry = (spread(6, foliar_moisture=needles, **values) for needles in (150.0, 100.0))
    surface = surface_consumption(fbp_fuels(torch.tensor(6)), torch.tensor(95.0), torch.tensor(120.0))
    assert wet.head > 20.0 and (wet.intensity / (300 * wet.head)).item() == pytest.approx(surface.item(), rel=1e-5)
    assert dry.head > wet.head and (dry.intensity / (300 * dry.head)).item() == pytest.approx(
        surface.item() + 1.8, rel=1e-2
    )


def test_the_kind_of_fire_is_that_of_the_share_of_crowns_that_burn():
    # C-2 with crowns from 3 m: none in damp air, some, then nine tenths. Aspen has no crowns to burn.
    damp = torch.tensor([70.0, 84.0, 95.0])
    conifers, aspen = (fbp_spread(torch.tensor([code]), **LEVEL, wind_speed=3.0, ffmc=damp) for code in (2, 11))
    assert conifers.kind.tolist() == [0.0, 1.0, 2.0] and aspen.kind.tolist() == [0.0] * 3
    assert fbp_spread(torch.tensor([102]), **LEVEL, wind_speed=3.0, ffmc=damp).kind.tolist() == [0.0] * 3
