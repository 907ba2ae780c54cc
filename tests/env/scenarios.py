"""Every scenario, small: what of TorchRL and torch must hold for all of them is asked of each."""

from functools import cache

import numpy as np
import pytest

from tests.world.mechanics import of_mechanics
from tests.world.mechanics.there import can_play
from warp_torchrl import make_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.runs.config.compose import conf_folder

OF_A_MAP = ("attack_landfire", "landfire", "spread_landfire", "wildland")
"""Scenarios whose ground is a folder of the user's."""
SMALL = ("landscape.size=16", "horizon=5")
SCENARIOS = tuple(sorted(path.stem for path in (conf_folder() / "scenario").glob("*.yaml")))
"""Names of all scenarios."""
MECHANICS = of_mechanics("WORLDS")
"""Worlds of mechanics, each alone."""


def joined(scenario):
    """The overrides of all mechanics' worlds of a scenario, in one."""
    worlds = [overrides for first, *overrides in MECHANICS.values() if first == f"scenario={scenario}"]
    told = dict.fromkeys(each for overrides in worlds for each in overrides)
    pairs = [each.split("=", 1) for each in told]
    shown = ",".join(value.strip("[]") for key, value in pairs if key == "observation.features")
    rest = [each for each in told if not each.startswith("observation.features=")]
    return (f"scenario={scenario}", *rest, f"observation.features=[{shown}]")


IN_ONE = {f"all of {each}": joined(each) for each in ("embers", "hetero") if can_play([f"scenario={each}"])}
"""Worlds with the mechanics of several of these worlds at once: each has state of its own."""
VARIANTS = ("arrivals by road", "breaches", "talks late", "tells late", "values by heat")
"""Worlds of mechanics that others hold too, under another law or with other numbers."""
APART = tuple(name for name in MECHANICS if MECHANICS[name][0] not in [each[0] for each in IN_ONE.values()])
"""Names of worlds of mechanics that are in none of these."""
FURTHER = {
    "told all": ("scenario=water", "observation=surroundings", "observation.rules=true", "observation.water=true",
                 "observation.near=16", "observation.reach=true", "observation.advice=dispatch"),
    "paper": ("scenario=skirmish", "observation=paper"),
    "of the map": ("scenario=skirmish", "observation=surroundings", "observation.centred=false",
                   "reward=collaborative"),
    "rates": ("scenario=skirmish", "fire=rate"),
    "tells in smoke": ("scenario=smoke", "mechanics.radio.carries=both", "mechanics.radio.delay=2",
                       "mechanics.radio.loss=0.1"),
    **MECHANICS,
    **IN_ONE,
}  # fmt: skip
FURTHER = {name: overrides for name, overrides in FURTHER.items() if can_play(overrides)}
"""Further worlds: what no scenario shows, does or pays."""
OF_MECHANICS = ("tells in smoke", *IN_ONE, *(each for each in APART if each not in VARIANTS))
BRIEFLY = ("skirmish", "wildland", "paper", *OF_MECHANICS)
"""Worlds that hold every mechanic and every kind of plane, role and law between them; ``-m slow`` plays the others."""
NAMES = (*SCENARIOS, *FURTHER)
WORLDS = [each if each in BRIEFLY else pytest.param(each, marks=pytest.mark.slow) for each in NAMES]


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
