"""The page: a local server that shows a match, plays it at a pace, and lets people take part."""

import socket
import sys
import threading
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import viser

from warp_torchrl.config.construction import ConfigError
from warp_torchrl.demonstrations.recording import OpenRecording
from warp_torchrl.live import words
from warp_torchrl.live.keeping import Keeper
from warp_torchrl.live.learning import Learning
from warp_torchrl.live.match import Match, Setting
from warp_torchrl.live.panel.panel import Panel
from warp_torchrl.live.panel.tab import told_if_refused
from warp_torchrl.live.scene import aim, furnish, local_server, places, quiet
from warp_torchrl.live.stage import Stage
from warp_torchrl.validation import check_fields

RECORDINGS = Path("recordings")
_FOLLOWED_EVERY = 5.0  # seconds between two looks for newer weights


@dataclass(frozen=True, kw_only=True)
class Address:
    """Where a page is served.

    Attributes:
        host: Network interface; the default is reachable from this machine alone.
        port: 0 takes any that is free.

    Raises:
        ValueError: If the port is out of its range.
    """

    host: str = "127.0.0.1"
    port: int = 8080

    def __post_init__(self) -> None:
        check_fields(self, port=(0, 65535))

    def free(self) -> "Address":
        """Return the address with a port that is free.

        Raises:
            ConfigError: If the port is taken, or the host is none of this machine's.
        """
        with socket.socket(socket.AF_INET6 if ":" in self.host else socket.AF_INET) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((self.host, self.port))
            except OSError as error:
                raise ConfigError(
                    f"port {self.port} cannot be used on {self.host} ({error.strerror}): choose another, port=NUMBER"
                ) from None
            return Address(host=self.host, port=probe.getsockname()[1])


class Page:
    """A match on a page. ``with`` serves it; ``play`` runs it until it is interrupted.

    All that changes the match holds ``lock``.

    Args:
        setting: What is played first.
        address: Where it is served.
        recordings: Folder of what is saved.

    Raises:
        ConfigError: If the setting or the address does not fit.
        CheckpointError: If a run folder holds no sound checkpoint.
    """

    def __init__(self, setting: Setting, address: Address, recordings: Path = RECORDINGS) -> None:
        self.given, self.match = setting, Match(setting)
        self.address = address.free()
        self.lock = threading.RLock()
        self.playing, self.pace = False, 8.0
        self.keeper, self.learning = Keeper(recordings), Learning(recordings)
        self._ended: OpenRecording | None = None  # of the last episode that was seen to end
        self._training = ""
        self._panels: dict[int, Panel] = {}
        self._stages: list[Stage] = []
        self._stopped = threading.Event()
        self._followed = time.monotonic()
        warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")  # of a browser that just left
        self.server = local_server(self.address.host, self.address.port)
        self._furnish()
        self.open(self.match)
        self.server.on_client_connect(self._welcome)
        self.server.on_client_disconnect(self._part)

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
        """Return the address for a browser."""
        return f"http://{self.address.host}:{self.address.port}"

    def play(self) -> None:
        """Play the match at its pace until ``stop``, or a signal."""
        while not self._stopped.is_set():
            began = time.monotonic()
            with self.lock:
                self._go_on()
            self._stopped.wait(max(0.002, 1.0 / self.pace - (time.monotonic() - began)))

    def stop(self) -> None:
        """Let ``play`` return."""
        self._stopped.set()

    # What panels ask for, under the lock

    def open(self, match: Match) -> None:
        """Show another match from its start.

        Raises:
            Refused: If the one before is to be kept and cannot be saved; it stays then.
        """
        self._keep()
        self.match, self.playing = match, False
        self._set_stages()
        for panel in self._panels.values():
            panel.fill()
        self.show()

    def step(self) -> None:
        """Advance the match by one step, and show it; the clock stops with the episode."""
        for line in self.match.step():
            self.tell(line)
        self.playing &= not self.match.ended
        self.show()
        side = self.match.sides[0]
        if side.ended and side.open_recording is not self._ended:
            self._ended = side.open_recording
            with told_if_refused(self.tell):
                self._keep()

    def restart(self, seed: int | None = None) -> None:
        """Start the episode anew; of another seed on its own ground.

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
        """Draw the match as it is, here and on every panel."""
        for stage, side in zip(self._stages, self.match.sides):
            stage.show(f"{words.title(side)}: {side.curves.saved[-1]:.0%} saved")
        for panel in list(self._panels.values()):
            panel.show()

    def tell(self, line: str, mistake: bool = False) -> None:
        """Tell everybody something."""
        for panel in list(self._panels.values()):
            panel.tell(line, mistake)

    # Parts

    def _set_stages(self) -> None:
        match = self.match
        for stage in self._stages:
            stage.remove()
        size, count = match.world.size, len(match.sides)
        self._stages = [
            Stage(self.server, index, side, east)
            for index, (side, east) in enumerate(zip(match.sides, places(size[1], count)))
        ]
        for index, stage in enumerate(self._stages):
            stage.tiles.on_click(self._clicked(index))
        aim(self.server, size, count, aside=0.15)  # the panel stands on the right

    def _go_on(self) -> None:
        with told_if_refused(self._stand_still):  # the page stays, to show what the match had come to
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
        try:
            folder = self.keeper.keep(self.match.sides[0])
        except ValueError as error:
            print(f"error: {error}", file=sys.stderr, flush=True)
        else:
            if folder is not None:
                print(f"saved {folder}", flush=True)

    def _furnish(self) -> None:
        furnish(self.server)
        self.server.gui.set_panel_label("warp_torchrl")

    def _welcome(self, client: viser.ClientHandle) -> None:
        with self.lock:
            self._panels[client.client_id] = Panel(self, client)
            self._panels[client.client_id].show()

    def _part(self, client: viser.ClientHandle) -> None:
        with self.lock:
            self._panels.pop(client.client_id, None)
            for name in self.match.sides[0].crew.leave(client.client_id):
                self.tell(f"{name} is the policy's again: who drove it has left")
            self.show()

    def _clicked(self, index: int) -> Callable[[viser.SceneNodePointerEvent], None]:
        def click(event: viser.SceneNodePointerEvent) -> None:
            with self.lock:
                panel = self._panels.get(event.client_id)
                if panel is not None:
                    panel.click(self._stages[index], event.ray_origin, event.ray_direction)

        return click

    def _follow(self) -> None:
        if time.monotonic() - self._followed < _FOLLOWED_EVERY:
            return
        self._followed = time.monotonic()
        for line in self.match.follow():
            self.tell(line)
        if (training := self.learning.told()) != self._training:
            self._training = training
            if not self.learning.goes_on:
                self.tell(training)
            self.show()
