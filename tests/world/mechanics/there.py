"""What is there: the folder of a mechanic can be deleted, and tests of all worlds choose from the rest."""

from collections.abc import Sequence
from importlib.util import find_spec

import pytest

from warp_torchrl.runs.config.compose import conf_folder


def is_there(*mechanics: str) -> bool:
    """Return whether the folders of mechanics are there."""
    return all(find_spec(f"warp_torchrl.world.mechanics.{name}") is not None for name in mechanics)


def needs(*mechanics: str) -> pytest.MarkDecorator:
    """Return the mark of a test that needs mechanics."""
    return pytest.mark.skipif(not is_there(*mechanics), reason=f"it needs {', '.join(mechanics)}")


def needs_scenario(name: str) -> pytest.MarkDecorator:
    """Return the mark of a test that needs a scenario, which goes with the mechanics that it names."""
    return pytest.mark.skipif(not can_play([f"scenario={name}"]), reason=f"it needs scenario {name}")


def can_play(overrides: Sequence[str]) -> bool:
    """Return whether the scenario that overrides choose is there, and the mechanics whose values they set."""
    keys = [override.partition("=") for override in overrides]
    scenarios = [value for key, _, value in keys if key == "scenario"]
    mechanics = [key.split(".")[1] for key, _, _ in keys if key.startswith("mechanics.")]
    return is_there(*mechanics) and all((conf_folder() / "scenario" / f"{name}.yaml").exists() for name in scenarios)
