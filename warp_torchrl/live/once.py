"""Cache of what all panels show of a match, by its state."""

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

Made = TypeVar("Made")


class Once:
    """Values by their keys. A page with many browsers makes its texts and pictures once for all."""

    def __init__(self) -> None:
        self._made: dict[Hashable, Any] = {}

    def __call__(self, what: Hashable, make: Callable[[], Made]) -> Made:
        """Return the value of a key; make it if it is missing."""
        if what not in self._made:
            self._made[what] = make()
        value: Made = self._made[what]
        return value

    def forget(self) -> None:
        """Drop all values: the match has changed."""
        self._made.clear()
