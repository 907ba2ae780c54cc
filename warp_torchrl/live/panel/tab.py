"""Tabs of a panel, and callbacks that show why an act was refused."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from warp_torchrl.live.door import LOG
from warp_torchrl.live.match import Match
from warp_torchrl.live.once import Once
from warp_torchrl.live.panel.controls import Callback, Controls, Window
from warp_torchrl.live.side import Side
from warp_torchrl.system.checksummed import Unsound
from warp_torchrl.system.foreign_text import plain_text


class Tab(ABC):
    """A tab of a panel; every match makes new tabs.

    Args:
        panel: The panel; the page's lock is held when the tab is made or painted.
    """

    title: str

    def __init__(self, panel: Window) -> None:
        self.panel, self.gui = panel, panel.gui
        self.make()

    @property
    def page(self) -> Controls:
        """Return the page."""
        return self.panel.page

    @property
    def match(self) -> Match:
        """Return the match that is shown."""
        return self.panel.page.match

    @property
    def side(self) -> Side:
        """Return the side that people take part on."""
        return self.match.sides[0]

    @abstractmethod
    def make(self) -> None:
        """Make the controls."""

    def paint(self) -> None:  # noqa: B027 - a tab may show nothing that changes
        """Show what takes long to make and to send."""

    def guarded(self, do: Callable[[Any], object]) -> Callback:
        """Return a callback that lets an act wait for its turn; it is given the control's new value."""
        return self.panel.guarded(do)

    def last(self) -> tuple[int, int]:
        """Return the row and column of the map's last cell."""
        rows, columns = self.match.world.size
        return rows - 1, columns - 1

    @property
    def once(self) -> Once:
        """Return what all panels show, made once for each state of the match."""
        return self.panel.page.once

    def middle(self) -> tuple[int, int]:
        """Return the row and column of the map's middle."""
        rows, columns = self.match.world.size
        return rows // 2, columns // 2


@contextmanager
def errors_shown(tell: Callable[[str, bool], object]) -> Iterator[None]:
    """Catch every error in this context and show it in one line, so that the match continues.

    An unexpected error is also logged in one line.
    """
    try:
        yield
    except (ValueError, OSError, Unsound) as error:
        _tell(tell, plain_text(str(error)))
    except Exception as error:
        line = plain_text(f"{type(error).__name__}: {error}")
        LOG.error("%s", line)
        _tell(tell, line)


def _tell(tell: Callable[[str, bool], object], line: str) -> None:
    try:
        tell(line, True)
    except Exception as error:  # of a browser that has just left
        LOG.error("%s, and nobody could be told: %s", line, plain_text(str(error)))


def chosen_option(dropdown: Any) -> str:
    """Return a dropdown's value. It must be one of the options: an invented one could name a file of this machine.

    Raises:
        ValueError: If it is none of the options.
    """
    if dropdown.value not in dropdown.options:
        raise ValueError(f"{dropdown.label} must be one of {', '.join(dropdown.options)}, got {dropdown.value}")
    return str(dropdown.value)
