"""Names in runs of former versions, translated to those of this one."""

from collections.abc import Iterable, Mapping
from typing import Any

_WRAPPERS = ("module", "network")


def parameters(state: Mapping[str, Any], names: Iterable[str]) -> dict[str, Any]:
    """Return a module's state by the names that its entries have now.

    Former versions wrapped networks in other modules: names are the same but for the wrappers.

    Args:
        state: As it was saved; entries that have no other name now stay as they are.
        names: Of the module's entries now.
    """
    now = {_unwrapped(name): name for name in names}
    return {now.get(_unwrapped(name), name): value for name, value in state.items()}


def _unwrapped(name: str) -> str:
    parts = name.split(".")
    inside = [
        part
        for before, part in zip(["", *parts], parts, strict=False)
        if part not in _WRAPPERS and not (before == "module" and part.isdigit())
    ]
    return ".".join(inside)
