"""The table of mechanics by name: those of the folders here, and those that users add."""

import pkgutil
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from typing import TypeVar

from warp_torchrl.validation import check_new_name
from warp_torchrl.world import mechanics as folder
from warp_torchrl.world.mechanics.mechanic import Mechanic

Kind = TypeVar("Kind", bound=type[Mechanic])
_TABLE: dict[str, type[Mechanic]] = {}
_PARTS: list[type[Mechanic]] = []


def mechanic(name: str) -> Callable[[Kind], Kind]:
    """Return what adds a dataclass to the table under a name, which is the name of its planes and its values too.

    Raises:
        ValueError: If the table has another module's mechanic of that name.
    """

    def add(kind: Kind) -> Kind:
        check_new_name("mechanic", name, kind, _TABLE.get(name))
        kind.name = name
        _TABLE[name] = kind
        return kind

    return add


def part(kind: Kind) -> Kind:
    """Add a dataclass that fills a part of the world, as ``team`` does, so that its ``maps`` are channels."""
    _PARTS.append(kind)
    return kind


def kinds() -> tuple[type[Mechanic], ...]:
    """Return all mechanics: those of the table, and those that fill a part of the world."""
    return (*mechanics().values(), *_PARTS)


def mechanics() -> Mapping[str, type[Mechanic]]:
    """Return all mechanics by name."""
    _load()
    return _TABLE


@cache
def _load() -> None:
    """Import what stands in the folders here, so that adding a folder adds a mechanic."""
    for each in pkgutil.walk_packages(folder.__path__, f"{folder.__name__}."):
        import_module(each.name)
