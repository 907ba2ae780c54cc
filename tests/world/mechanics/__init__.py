"""Tests of mechanics, a folder each; its ``worlds.py`` says in which worlds and runs tests of other rooms meet it."""

from importlib import import_module
from pathlib import Path

from tests.world.mechanics.there import can_play


def of_mechanics(name: str) -> dict:
    """What the ``worlds.py`` of all mechanics hold under a name, joined: what the mechanics that are there can play."""
    found = {}
    for path in sorted(Path(__file__).parent.glob("*/worlds.py")):
        found |= getattr(import_module(f"{__name__}.{path.parent.name}.worlds"), name, {})
    return {of: overrides for of, overrides in found.items() if can_play(overrides)}
