"""Protocols of the panel: what its parts need of the page, and what tabs need of the panel around them."""

from collections.abc import Callable, Coroutine
from typing import Any, Protocol

import viser

from warp_torchrl.env.pictures.veil import View
from warp_torchrl.live.inbox import Act
from warp_torchrl.live.keeping import Keeper
from warp_torchrl.live.learning import PageTraining
from warp_torchrl.live.match import Match, Setting
from warp_torchrl.live.once import Once

Callback = Callable[[Any], Coroutine[Any, Any, None]]
"""Called by viser in the server's thread."""


class Controls(Protocol):
    """The page, as a panel controls it. All but ``ask`` is called under the page's lock."""

    match: Match
    given: Setting
    playing: bool
    pace: float
    view: View
    once: Once
    keeper: Keeper
    learning: PageTraining

    def ask(self, person: int, act: Act) -> None:
        """Queue an act of a person."""
        ...

    def set_pace(self, pace: float) -> None:
        """Set the steps a second."""
        ...

    def set_view(self, view: str) -> None:
        """Choose what the scene and the map show."""
        ...

    def open(self, match: Match) -> None:
        """Show another match from its start."""
        ...

    def step(self) -> None:
        """Advance the match by one step, and show it."""
        ...

    def restart(self, seed: int | None = None) -> None:
        """Restart the episode."""
        ...

    def show(self) -> None:
        """Draw the match on all panels."""
        ...

    def tell(self, line: str, mistake: bool = False) -> None:
        """Notify everybody."""
        ...


class Vehicles(Protocol):
    """The tab in which a vehicle is chosen and driven."""

    def send_to(self, cell: tuple[int, int]) -> None:
        """Send the chosen vehicle to a cell."""
        ...


class Choice(Protocol):
    """The open question of a match."""

    def choose(self, action: int) -> bool:
        """Answer it with another action; return whether there was one."""
        ...


class Window(Protocol):
    """The panel of one browser, as its tabs see it."""

    @property
    def page(self) -> Controls:
        """Return the page."""
        ...

    @property
    def gui(self) -> viser.GuiApi:
        """Return the browser's controls."""
        ...

    @property
    def person(self) -> int:
        """Return the number of the person at the browser."""
        ...

    @property
    def agent(self) -> int:
        """Return the index of the chosen vehicle."""
        ...

    @property
    def drive(self) -> Vehicles:
        """Return the tab that drives."""
        ...

    @property
    def question(self) -> Choice:
        """Return the open question."""
        ...

    def guarded(self, do: Callable[[Any], object]) -> Callback:
        """Return a callback that queues an act, and reports its refusal."""
        ...

    def show(self, paints: bool = True) -> None:
        """Show the match."""
        ...
