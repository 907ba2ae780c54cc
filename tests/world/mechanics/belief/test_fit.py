"""Fit of beliefs to the fire, in numbers worked out by hand."""

import pytest
import torch

from tests.world.mechanics.belief.worlds import reset, rules
from warp_torchrl.world.mechanics.belief.belief import Ensemble
from warp_torchrl.world.mechanics.belief.beliefs import beliefs_of
from warp_torchrl.world.mechanics.belief.fit import brier_skill

UNKNOWN = {"rate_deviation": 0.3, "wind_speed_deviation": 0.2, "bearing_deviation": 15.0}


def test_skill_is_how_much_less_a_belief_errs_than_one_without_fire():
    burns = torch.tensor([[[True, True, False, False]]])
    p = torch.tensor([[[[1.0, 0.5, 0.0, 0.5]]]])
    # Errors 0, 0.25, 0 and 0.25, where two cells burn: 1 - 0.5 / 2.
    assert brier_skill(p, burns).tolist() == [0.75]
    assert brier_skill(torch.cat((p, torch.zeros_like(p)), dim=1), burns).tolist() == [0.375], "the mean of two beliefs"
    assert brier_skill(p, torch.zeros_like(burns)).tolist() == [0.0]


def test_how_well_beliefs_fit_is_measured():
    world = rules(belief=Ensemble(members=4, hidden=0, particles=16, **UNKNOWN))
    state = reset(world)
    held = beliefs_of(state)
    values = held.learning.particles.clone()
    values[..., 0], values[..., 1], values[..., 2] = torch.linspace(-1.0, 1.0, 16), 0.5, -0.5
    held = held.replace(
        learning=held.learning.replace(particles=values, prior=torch.tensor([[2.0, 1.0, 1.0]])),
        overlap=torch.tensor([3], dtype=torch.int32),
        union=torch.tensor([4], dtype=torch.int32),
        skills=torch.tensor([1.5]),
        alight=torch.tensor([2], dtype=torch.int32),
    )
    found = world.belief.metrics(state.with_planes("belief", held))
    # 16 values -1, -13/15, ... 1 have the variance (16^2 - 1) / 12 (2 / 15)^2 = 0.3778
    assert {name: value.item() for name, value in found.items()} == pytest.approx(
        {
            "jaccard": 0.75,
            "skill": 0.75,
            "rate_known": 1.0,
            "rate_doubt": 0.3778**0.5 / 2.0,
            "wind_speed_known": 0.0,
            "wind_speed_doubt": 0.0,
            "bearing_known": 0.0,
            "bearing_doubt": 0.0,
        },
        abs=1e-4,
    )
    assert {*found} <= {*world.metric_names}
