"""Every scenario, small: what of TorchRL and torch must hold for all of them is asked of each."""

from functools import cache

import numpy as np
import pytest

from tests.world.mechanics import of_mechanics
from warp_torchrl import make_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.runs.config.compose import conf_folder

OF_A_MAP = ("attack_landfire", "landfire", "spread_landfire", "wildland")
"""Scenarios whose ground is a folder of the user's."""
SMALL = ("landscape.size=16", "horizon=5")
SCENARIOS = tuple(sorted(path.stem for path in (conf_folder() / "scenario").glob("*.yaml")))
"""Names of all scenarios."""
FURTHER = {
    "told all": ("scenario=water", "observation=surroundings", "observation.rules=true", "observation.water=true",
                 "observation.near=16", "observation.reach=true", "observation.advice=dispatch"),
    "paper": ("scenario=skirmish", "observation=paper"),
    "of the map": ("scenario=skirmish", "observation=surroundings", "observation.centred=false",
                   "reward=collaborative"),
    "rates": ("scenario=skirmish", "fire=rate"),
    **of_mechanics("WORLDS"),
}  # fmt: skip
"""Further worlds: what no scenario shows, does or pays."""
BRIEFLY = ("default", "skirmish", "smoke", "agencies", "wildland", "paper", *of_mechanics("WORLDS"))
"""Worlds that hold every kind of plane, role and law between them; the others are played by ``-m slow``."""
WORLDS = [each if each in BRIEFLY else pytest.param(each, marks=pytest.mark.slow) for each in (*SCENARIOS, *FURTHER)]


def ground(folder):
    """Write a map of 24 x 24 forest cells with the layers that the scenarios of maps read."""
    rasters = pytest.importorskip("tests.world.rasters")
    height = np.add.outer(np.arange(24.0), np.arange(24.0))
    rasters.write(folder / "map_Elev.tif", height)
    rasters.write(folder / "map_F40.tif", np.full((24, 24), 165), "int16")
    rasters.write(folder / "map_F13.tif", np.full((24, 24), 8), "int16")
    rasters.write(folder / "map_CC.tif", np.full((24, 24), 60), "int16")
    return folder


@cache
def made(name, folder):
    """Make the environment of a name once: to read its configuration takes the most time."""
    told = FURTHER.get(name, (f"scenario={name}",))
    scenario, overrides = told[0].removeprefix("scenario="), [*SMALL, *told[1:]]
    if scenario in OF_A_MAP:
        overrides += [f"landscape.path={ground(folder)}", "ignition.head_start=3"]
    return make_env(scenario, n_worlds=1, overrides=overrides)


def env_of(name, folder, n_worlds=3, **options):
    """Make the small worlds of a name; the ground of those that need one is written into a folder."""
    like = made(name, folder)
    parts = {"observation": like.observation, "reward": like.reward_function}
    return WildfireEnv(like.world, **parts, n_worlds=n_worlds, **options)
