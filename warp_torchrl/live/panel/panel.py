"""One browser's controls on the page."""

from collections.abc import Callable
from functools import partial
from typing import Any

import viser

from warp_torchrl.live import words
from warp_torchrl.live.ground import cell_at
from warp_torchrl.live.panel.agent import AgentTab
from warp_torchrl.live.panel.controls import Callback, Controls
from warp_torchrl.live.panel.drive import DRIVE_KEYS, DriveTab
from warp_torchrl.live.panel.match import MatchTab
from warp_torchrl.live.panel.question import QuestionBox
from warp_torchrl.live.panel.record import RecordTab
from warp_torchrl.live.panel.tab import Tab, errors_shown
from warp_torchrl.live.panel.watch import WatchTab
from warp_torchrl.live.panel.world import WorldTab
from warp_torchrl.live.stage import Stage, change
from warp_torchrl.system.foreign_text import plain_text

PACES = (1, 30)
"""Steps a second that can be chosen."""


def notify(client: viser.ClientHandle, line: str, mistake: bool = False) -> None:
    """Show a message at one browser."""
    title = "This cannot be done" if mistake else "Told"
    client.add_notification(title, plain_text(line), auto_close_seconds=7.0, color="red" if mistake else None)


class Panel:
    """The controls of one browser, and what they show.

    Args:
        page: What they control; its lock is held when they are made or shown.
        client: The browser.
    """

    def __init__(self, page: Controls, client: viser.ClientHandle) -> None:
        self.page, self.gui, self._client = page, client.gui, client
        self._own: list[Any] = []
        self._add_keys()
        self.fill()

    @property
    def person(self) -> int:
        """Return the number of the person at the browser."""
        return self._client.client_id

    @property
    def agent(self) -> int:
        """Return the index of the vehicle that is chosen."""
        return self.drive.agent

    # What is made

    def fill(self) -> None:
        """Make the controls of the present match."""
        for handle in self._own:
            handle.remove()
        play, self.question = self._add_play(), QuestionBox(self)
        self._own = [play, self.question.folder, tabs := self.gui.add_tab_group()]
        self._tabs: list[Tab] = []
        for kind in (WatchTab, DriveTab, AgentTab, WorldTab, RecordTab, MatchTab):
            with tabs.add_tab(kind.title):
                self._tabs.append(kind(self))
        self.drive = next(each for each in self._tabs if isinstance(each, DriveTab))
        self.world = next(each for each in self._tabs if isinstance(each, WorldTab))

    def _add_play(self) -> Any:
        gui, folder = self.gui, self.gui.add_folder("Play")
        with folder:
            self._headline = gui.add_markdown("")
            play = gui.add_button_group("", ("Play", "Pause", "Step", "Restart"))
            low, high = PACES
            present = min(max(round(self.page.pace), low), high)
            pace = gui.add_slider("Steps a second", min=low, max=high, step=1, initial_value=present)
            self._numbers = gui.add_markdown("")
        play.on_click(self.guarded(self._play))
        pace.on_update(self.guarded(self.page.set_pace))
        return folder

    def _add_keys(self) -> None:
        for key, action in DRIVE_KEYS.items():
            command = self.gui.add_command(f"Drive: {action}", hotkey=key)
            command.on_trigger(self.guarded(partial(self._press, action)))
        agree = self.gui.add_command("Do it", hotkey="G")
        agree.on_trigger(self.guarded(lambda _: self.question.answer(True)))
        play = self.gui.add_command("Play or pause", hotkey="P")
        play.on_trigger(self.guarded(lambda _: self._play("Pause" if self.page.playing else "Play")))

    # What is shown

    def show(self, paints: bool = True) -> None:
        """Show the present state of the match.

        Args:
            paints: Whether the tabs are painted too, which takes longer.
        """
        match, once = self.page.match, self.page.once
        with self._client.atomic():
            change(self._headline, content=once("headline", lambda: words.headline(match)))
            change(self._numbers, content=once("numbers", lambda: words.numbers_table(match)))
            self.question.show()
            if paints:
                for tab in self._tabs:
                    tab.paint()

    def tell(self, line: str, mistake: bool = False) -> None:
        """Show a message to the person."""
        notify(self._client, line, mistake)

    # What is done, in turn with other people's; told in one line where it cannot be

    def guarded(self, do: Callable[[Any], object]) -> Callback:
        """Return a callback that queues an act, and shows the reason if the act is refused.

        Args:
            do: Does the act. Its argument is the control's value as the person set it, or None for a command.
        """

        def act(value: object) -> None:
            with errors_shown(self.tell):
                do(value)

        async def call(event: Any) -> None:  # in the server's thread, as messages come
            if event.client_id is not None:  # else the page itself has set the control
                self.page.ask(self.person, partial(act, getattr(event.target, "value", None)))

        return call

    def click(self, stage: Stage, origin: tuple[float, float, float], direction: tuple[float, float, float]) -> None:
        """Do what a click on a cell is to do."""
        with errors_shown(self.tell):
            x, y, z = origin
            cell = cell_at((x - stage.east, y, z), direction, stage.ground)
            if cell is not None:
                self.world.click(cell)

    def _play(self, button: str) -> None:
        page = self.page
        if button == "Restart":
            page.restart()
            return
        page.playing = button == "Play" and not page.match.ended
        (page.step if button == "Step" else page.show)()

    def _press(self, action: str, _: object) -> None:
        self.drive.press(action)
