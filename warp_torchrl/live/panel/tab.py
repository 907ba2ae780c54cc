"""What every tab has: its part of the panel, and callbacks that tell what is refused."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from warp_torchrl.live.match import Match
from warp_torchrl.live.side import Side
from warp_torchrl.runs.sealed import Unsound

if TYPE_CHECKING:
    from warp_torchrl.live.page import Page
    from warp_torchrl.live.panel.panel import Panel


class Tab(ABC):
    """A tab of a panel; it is made anew for every match.

    Args:
        panel: What it is part of; the page's lock is held when it is made or painted.
    """

    title: str

    def __init__(self, panel: "Panel") -> None:
        self.panel, self.gui = panel, panel.gui
        self.make()

    @property
    def page(self) -> "Page":
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

    def guarded(self, do: Callable[[Any], object]) -> Callable[[Any], None]:
        """Return a callback that does something under the page's lock, and tells what is refused."""
        return self.panel.guarded(do)

    def middle(self) -> tuple[int, int]:
        """Return the row and column of the map's middle."""
        rows, columns = self.match.world.size
        return rows // 2, columns // 2


@contextmanager
def told_if_refused(tell: Callable[[str, bool], object]) -> Iterator[None]:
    """Tell an error in one line: a page must not fall silent, and the match goes on as it was."""
    try:
        yield
    except (ValueError, OSError, Unsound) as error:
        tell(" ".join(str(error).split()), True)
    except Exception as error:
        tell(f"{type(error).__name__}: {' '.join(str(error).split())}", True)


def chosen(dropdown: Any) -> str:
    """Return what is chosen, which a browser may not make up: it could name a file of this machine.

    Raises:
        ValueError: If it is none of the options.
    """
    if dropdown.value not in dropdown.options:
        raise ValueError(f"{dropdown.label} must be one of {', '.join(dropdown.options)}, got {dropdown.value}")
    return str(dropdown.value)
