"""Small worlds that the tests of the upper floors share."""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # the tests run side by side; read when torch is imported

import pytest
import torch

from warp_torchrl.env import WildfireEnv
from warp_torchrl.world.ignition import Ignition
from warp_torchrl.world.landscape import Perlin
from warp_torchrl.world.team import Team
from warp_torchrl.world.wind import Uniform
from warp_torchrl.world.world import World


def small_world(**changes):
    """A 12 x 12 world with two bulldozers whose fire ticks every third step."""
    parts = {
        "landscape": Perlin(size=12, relief=40.0),
        "wind": Uniform(speed=4.0),
        "team": Team(n_agents=2),
        "ignition": Ignition(count=1),
        "steps_per_tick": 3,
        "horizon": 40,
    }
    return World(**{**parts, **changes})


@pytest.fixture
def make_small_env():
    """Make an environment of small worlds; keywords of World and of WildfireEnv."""

    def make(n_worlds=4, world=None, **options):
        return WildfireEnv(world or small_world(), n_worlds=n_worlds, **options)

    return make


@pytest.fixture(autouse=True)
def _same_start():
    torch.manual_seed(0)
