"""The page: a local server that shows a match, plays it at a pace, and lets people take part."""

import sys
import threading
import time
import warnings
from functools import partial
from pathlib import Path
from weakref import WeakKeyDictionary

import viser

from warp_torchrl.demonstrations.recording import OpenRecording
from warp_torchrl.env.pictures.veil import View, checked_view, first_view
from warp_torchrl.live import words
from warp_torchrl.live.address import Address
from warp_torchrl.live.door import Door, arrived
from warp_torchrl.live.inbox import Act, Inbox
from warp_torchrl.live.keeping import Keeper
from warp_torchrl.live.learning import PageTraining
from warp_torchrl.live.match import Match, Setting
from warp_torchrl.live.once import Once
from warp_torchrl.live.panel.panel import PACES, Panel, notify
from warp_torchrl.live.panel.tab import errors_shown
from warp_torchrl.live.scene import aim, furnish, local_server, map_offsets, quiet
from warp_torchrl.live.screening import Screen
from warp_torchrl.live.stage import Stage
from warp_torchrl.system.foreign_text import plain_text

RECORDINGS = Path("recordings")
_FOLLOWED_EVERY = 5.0  # seconds between two looks for newer weights
_PAINTED_EVERY = 0.25  # seconds between two pictures of what takes long to make, while the match plays
_PAINTED_SHARE = 0.2  # of the time that these pictures may take


class Page:
    """A match on a page. ``with`` serves it; ``play`` runs it until it is interrupted.

    ``play`` carries out people's acts in the thread that plays. Code that changes the match elsewhere holds ``lock``.

    Args:
        setting: The first match.
        address: Host, port and token.
        recordings: Folder of saved recordings.

    Raises:
        ConfigError: If the setting or the address does not fit.
        CheckpointError: If a run folder holds no sound checkpoint.
    """

    def __init__(self, setting: Setting, address: Address, recordings: Path = RECORDINGS) -> None:
        self.given, self.match = setting, Match(setting)
        listener, self.address, access = address.listen()
        self.lock = threading.RLock()
        self.inbox, self.once = Inbox(), Once()
        self.playing, self.pace = False, 8.0
        self.view: View = first_view(self.match.world)
        self.keeper, self.learning = Keeper(recordings), PageTraining(recordings)
        self._ended: OpenRecording | None = None  # of the last episode that was seen to end
        self._training = ""
        self._panels: dict[int, Panel] = {}
        self._stages: list[Stage] = []
        self._clients: WeakKeyDictionary[object, viser.ClientHandle] = WeakKeyDictionary()  # by connection
        self._is_left_out: set[int] = set()  # persons who were told that they ask for too much
        self._stopped = threading.Event()
        self._followed = time.monotonic()
        self._painted, self._painting_took = 0.0, 0.0
        warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")  # of a browser that just left
        self.server = local_server(Door(listener, access, Screen(self._clients)))
        self._furnish()
        self.open(self.match)
        self.server.on_client_connect(self._arrive)
        self.server.on_client_disconnect(self._leave)

    def __enter__(self) -> "Page":
        return self

    def __exit__(self, *error: object) -> None:
        self._stopped.set()
        with self.lock:
            self._keep_the_last()
            if self.learning.goes_on:
                print(f"{self.learning.folder} saves and ends", flush=True)
            self.learning.close()
        with quiet():
            self.server.stop()

    @property
    def url(self) -> str:
        """Return the address for a browser, with the token."""
        return self.address.url

    def play(self) -> None:
        """Play the match at its pace, and carry out people's acts, until ``stop`` or a signal."""
        while not self._stopped.is_set():
            began = time.monotonic()
            with self.lock:
                self._go_on()
            for act in self.inbox.until(max(time.monotonic() + 0.002, began + 1.0 / self.pace)):
                with self.lock, errors_shown(self.tell):
                    act()

    def stop(self) -> None:
        """Let ``play`` return."""
        self._stopped.set()
        self.inbox.close()

    def ask(self, person: int, act: Act) -> None:
        """Let an act of a person wait for its turn. If too many wait, drop it and inform the person once.

        It runs in the server's thread. Acts of people that have left are dropped.
        """
        client = next((each for each in self._clients.values() if each.client_id == person), None)
        if client is None:
            return
        if self.inbox.put(person, act):
            self._is_left_out.discard(person)
        elif person not in self._is_left_out:
            self._is_left_out.add(person)
            notify(client, "the page cannot keep up: some of what you asked for is left out", mistake=True)

    def set_pace(self, pace: float) -> None:
        """Set the pace [steps / s].

        Raises:
            ValueError: If it is out of ``PACES``.
        """
        if not PACES[0] <= pace <= PACES[1]:
            raise ValueError(f"steps a second must be in {PACES[0]}..{PACES[1]}, got {pace}")
        self.pace = float(pace)

    def set_view(self, view: str) -> None:
        """Choose what the scene and the map show, for everybody.

        Raises:
            ValueError: If it is none of ``VIEWS``.
        """
        self.view = checked_view(view)
        self.show()

    # What panels ask for, under the lock

    def open(self, match: Match) -> None:
        """Show another match from its start.

        Raises:
            Refused: If the one before is to be kept and cannot be saved; it stays then, as with any other error.
        """
        self._keep()
        before, view, self.playing = self.match, self.view, False
        self.view = first_view(match.world)
        try:
            self._present(match)
        except Exception:
            self.view = view
            self._present(before)
            raise

    def step(self) -> None:
        """Advance the match by one step, and show it; the clock stops with the episode."""
        for line in self.match.step():
            self.tell(line)
        self.playing &= not self.match.ended
        self.show()
        side = self.match.sides[0]
        if side.ended and side.open_recording is not self._ended:
            self._ended = side.open_recording
            with errors_shown(self.tell):
                self._keep()

    def restart(self, seed: int | None = None) -> None:
        """Restart the episode; another seed has another ground.

        Raises:
            ValueError: If the seed is out of range.
            Refused: If the episode is to be kept and cannot be saved; it stays then.
        """
        self._keep()
        self.match.restart(seed)
        self.playing = False
        self._set_stages()
        self.show()

    def show(self) -> None:
        """Draw the match, here and on every panel; while it plays, pictures and curves are drawn less often."""
        self.once.forget()
        for stage, side in zip(self._stages, self.match.sides):
            stage.show(f"{words.title(side)}: {side.curves.saved[-1]:.0%} saved", self.view)
        began = time.monotonic()
        every = max(_PAINTED_EVERY, self._painting_took / _PAINTED_SHARE)
        paints = not self.playing or began - self._painted > every
        for panel in list(self._panels.values()):
            panel.show(paints)
        if paints:
            self._painted, self._painting_took = began, time.monotonic() - began

    def tell(self, line: str, mistake: bool = False) -> None:
        """Show a message to all people."""
        for panel in list(self._panels.values()):
            panel.tell(line, mistake)

    # Parts

    def _present(self, match: Match) -> None:
        self.match = match
        self._set_stages()
        for panel in self._panels.values():
            panel.fill()
        self.show()

    def _set_stages(self) -> None:
        match = self.match
        for stage in self._stages:
            stage.remove()
        size, count = match.world.size, len(match.sides)
        self._stages = [
            Stage(self.server, index, side, east)
            for index, (side, east) in enumerate(zip(match.sides, map_offsets(size[1], count)))
        ]
        for stage in self._stages:
            stage.tiles.on_click(partial(self._click, stage))
        aim(self.server, size, count, aside=0.15)  # the panel stands on the right

    def _go_on(self) -> None:
        with errors_shown(self._stand_still):  # the page stays, to show what the match had come to
            self._follow()
            if self.playing:
                self.step()

    def _stand_still(self, line: str, mistake: bool) -> None:
        self.playing = False
        self.tell(line, mistake)

    def _keep(self) -> None:
        folder = self.keeper.keep(self.match.sides[0])
        if folder is not None:
            self.tell(f"saved {folder}")
            self.show()

    def _keep_the_last(self) -> None:
        """Save the episode that is being played when the page ends, and say so where it was started."""
        with errors_shown(lambda line, mistake: print(f"error: {line}", file=sys.stderr, flush=True)):
            folder = self.keeper.keep(self.match.sides[0])
            if folder is not None:
                print(f"saved {plain_text(str(folder))}", flush=True)

    def _furnish(self) -> None:
        furnish(self.server)
        self.server.gui.set_panel_label("warp_torchrl")

    # What browsers do; in the server's thread, which waits for nothing

    async def _arrive(self, client: viser.ClientHandle) -> None:
        self._clients[arrived.get()] = client
        self.inbox.put_alone(client.client_id, partial(self._welcome, client))

    async def _leave(self, client: viser.ClientHandle) -> None:
        for connection in [each for each, its in self._clients.items() if its is client]:
            del self._clients[connection]
        self.inbox.put_alone(client.client_id, partial(self._part, client))

    async def _click(self, stage: Stage, event: viser.SceneNodePointerEvent) -> None:
        panel = self._panels.get(event.client_id)
        if panel is not None:
            self.ask(event.client_id, partial(panel.click, stage, event.ray_origin, event.ray_direction))

    # The same in the thread that plays

    def _welcome(self, client: viser.ClientHandle) -> None:
        if client not in self._clients.values():
            return  # it has left already
        with errors_shown(partial(notify, client)):
            panel = self._panels[client.client_id] = Panel(self, client)
            panel.show()

    def _part(self, client: viser.ClientHandle) -> None:
        self._panels.pop(client.client_id, None)
        self._is_left_out.discard(client.client_id)
        for name in self.match.sides[0].crew.leave(client.client_id):
            self.tell(f"{name} is the policy's again: who drove it has left")
        with errors_shown(self.tell):
            self.show()

    def _follow(self) -> None:
        if time.monotonic() - self._followed < _FOLLOWED_EVERY:
            return
        self._followed = time.monotonic()
        for line in self.match.follow():
            self.tell(line)
        if (training := self.learning.status()) != self._training:
            self._training = training
            if not self.learning.goes_on:
                self.tell(training)
            self.show()
