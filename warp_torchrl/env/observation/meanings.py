"""The meaning of each number and plane of an observation in words, from the docstrings of what shows it."""

import inspect
import re
from collections.abc import Callable, Mapping
from typing import Any

from warp_torchrl.env.observation.channels import CHANNELS
from warp_torchrl.env.observation.coarse_picture import PICTURE
from warp_torchrl.env.observation.features import Features
from warp_torchrl.env.observation.status import STATUS
from warp_torchrl.world.world import World

_TABLES: Mapping[str, Features] = {"view": CHANNELS, "picture": PICTURE, "near": PICTURE, "status": STATUS}
_SEE = re.compile(r",? see ``([\w.]+)``")
_SHAPE = re.compile(r",? (?:float32|int64|uint8) \[[^\]]*\]")
_FURTHER = 2
"""Paragraphs that are quoted of a docstring that another one refers to."""


def meanings(entry: str, world: World) -> dict[str, str]:
    """Return the meaning of the numbers or planes of an entry by name; empty for an entry without a table.

    Args:
        entry: Name of the entry, such as ``view``.
        world: Any world; names that only other worlds have are left out.
    """
    table = _TABLES.get(entry, Features("nothing"))
    found = {name: _meaning(feature.show) for name, feature in table.items()}
    return found | {
        name: _meaning(feature.show)
        for feature in table.values()
        for part in feature.parts(world)
        for name in part.names
    }


def highs(entry: str) -> dict[str, int]:
    """Return the largest whole number of each plane of an entry in bytes, by name."""
    return {name: feature.high for name, feature in _TABLES.get(entry, {}).items()}


def _meaning(show: Callable[..., Any]) -> str:
    """Return a docstring in one line, where each reference is replaced by the docstring that it names."""
    told = _first(show, 1)
    for reference in _SEE.findall(told):
        other = _found(reference, getattr(show, "__globals__", {}))
        told = told.replace(f"see ``{reference}``", f"which is: {_first(other, _FURTHER)}" if other else reference)
    return _SHAPE.sub("", told).replace("``", "").rstrip(".")


def _first(show: Callable[..., Any], paragraphs: int) -> str:
    parts = (inspect.getdoc(show) or "").split("\n\n")
    kept = [" ".join(part.split()) for part in parts[:paragraphs] if not part.startswith(("Args:", "Raises:"))]
    return " ".join(kept).removeprefix("Return ")


def _found(reference: str, known: Mapping[str, Any]) -> Callable[..., Any] | None:
    first, *rest = reference.split(".")
    found = known.get(first)
    for name in rest:
        found = getattr(found, name, None)
    return found if callable(found) else None
