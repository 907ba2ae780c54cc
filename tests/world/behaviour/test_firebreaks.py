"""Breaches of firebreaks, as the source prints them."""

import pytest
import torch

from warp_torchrl.world.behaviour.firebreaks import breach_chance, holds_up_to, intensity_of
from warp_torchrl.world.behaviour.surface import flame_length

TREES = {False: [(2000.0, 3.0, 0.29), (2000.0, 5.0, 0.05)], True: [(5000.0, 10.0, 0.35), (5000.0, 3.0, 0.88)]}


@pytest.mark.parametrize("trees", TREES)
def test_chances_of_a_plot_are_those_of_the_source(trees: bool) -> None:
    for intensity, width, chance in TREES[trees]:
        found = breach_chance(torch.tensor([intensity, 1e6]), width, torch.tensor(trees), 100.0)
        assert found[0].item() == pytest.approx(chance, abs=0.006)
        strongest = breach_chance(torch.tensor(17_000.0), width, torch.tensor(trees), 100.0)
        assert found[1].item() == strongest.item(), "no fire there was stronger"


def test_parts_hold_together_as_the_whole_does() -> None:
    part, whole = (breach_chance(torch.tensor(4000.0), 5.0, torch.tensor(True), each) for each in (25.0, 100.0))
    assert 1.0 - (1.0 - part.item()) ** 4 == pytest.approx(whole.item(), rel=1e-5)


@pytest.mark.parametrize("trees", TREES)
def test_a_part_holds_up_to_the_intensity_whose_chance_is_its_draw(trees: bool) -> None:
    intensity, width = torch.tensor([500.0, 4000.0, 16_000.0]), torch.tensor(3.0)
    draw = breach_chance(intensity, 3.0, torch.tensor(trees), 30.0)
    assert torch.allclose(holds_up_to(draw, width, trees, 30.0), intensity, rtol=2e-3)
    above = breach_chance(torch.tensor([17_000.0]), 3.0, torch.tensor(trees), 30.0) + 1e-4
    assert holds_up_to(above, width, trees, 30.0).item() == float("inf"), "no fire there was stronger"
    assert holds_up_to(torch.zeros(1), width, trees, 30.0).item() == float("-inf")


def test_an_intensity_has_its_flames() -> None:
    assert flame_length(torch.tensor(intensity_of(3.0))).item() == pytest.approx(3.0, rel=1e-2)
