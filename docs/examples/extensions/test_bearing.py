"""The way to the fire, by hand, and as networks read it."""

import pytest
import torch
from bearing import Bearing

from tests.env.observation.test_observation import drawn
from warp_torchrl import make_env
from warp_torchrl.models import LOGITS, Mlp, signature
from warp_torchrl.models.canonical import Canonicalise


def test_it_points_to_the_middle_of_the_fire():
    cells = torch.full((10, 20), 5)
    cells[2, 8] = cells[2, 10] = 11
    state, world = drawn(cells.tolist(), [[2, 9], [4, 4]])
    shown = Bearing()(state, world, world.forecast(state))["bearing"][0].tolist()
    assert shown[0] == [0.0, 0.0]
    assert shown[1] == pytest.approx([5 / 20, 2 / 10])
    state, world = drawn(torch.full((10, 20), 5).tolist(), [[2, 9]])
    assert not Bearing()(state, world, world.forecast(state))["bearing"].any()


def test_the_default_model_reads_it_in_canonical_orientation():
    env = make_env(
        "skirmish", n_worlds=16, plugins=["bearing"], overrides=["observation=bearing", "observation.radius=32"]
    )
    shape, now = signature(env), env.reset()
    east, north = Canonicalise(shape.observation)(now.clone())["agents", "canonical_bearing"].unbind(-1)
    raw = now["agents", "observation", "bearing"]
    assert (east.minimum(-north) >= -0.1).all() and (raw < -0.2).any(), "the fire is to the east and south-east"
    assert Mlp().actor(shape)(now)[LOGITS].shape == (16, env.n_agents, 11)
