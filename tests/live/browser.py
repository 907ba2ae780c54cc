"""A browser without a screen, as far as its server can tell: viser's messages over a websocket."""

import threading
import time

import msgspec
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (0.0, -60.0, 60.0), "fov": 0.8,
    "near": 0.1, "far": 1000.0, "image_height": 600, "image_width": 800, "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}  # fmt: skip


def until(holds, seconds=30.0):
    """Wait until something is so."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "it took too long"
        time.sleep(0.01)


class Browser:
    """One browser on a page, which has its controls when it is made."""

    def __init__(self, port, token, reads=True):
        self.link = connect(
            f"ws://127.0.0.1:{port}/?token={token}", subprotocols=[f"viser-v{viser.__version__}"], max_size=None,
            compression=None, close_timeout=2,
        )  # fmt: skip
        self.controls, self.commands, self.told = {}, {}, []
        if reads:
            threading.Thread(target=self._read, daemon=True).start()
        self.send(CAMERA)
        if reads:
            until(lambda: self.texts("step"))

    def send(self, message):
        """Send a message, or bytes as they are."""
        self.link.send(message if isinstance(message, str | bytes) else msgspec.msgpack.encode(message))

    def find(self, label):
        """Return the uuid of the control that has a label and a value."""
        return self._first(lambda each: "value" in each and each["props"].get("label") == label)

    def set(self, label, value):
        """Give a control a value, which the browser shows."""
        self.controls[self.find(label)]["value"] = value
        self.send({"type": "GuiUpdateMessage", "uuid": self.find(label), "updates": {"value": value}})

    def press(self, button):
        """Press a button of a group."""
        uuid = self._first(lambda each: button in (each["props"].get("options") or ()))
        self.send({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": button}})

    def _first(self, fits):
        return next(uuid for uuid, each in list(self.controls.items()) if fits(each))

    def value(self, name):
        """Return what the browser shows in a control."""
        return self.controls[self.find(name)]["value"]

    def texts(self, part):
        """Return the lines of its texts that have a part."""
        shown = [str(each["props"].get("_markdown", "")) for each in list(self.controls.values())]
        return [line for text in shown for line in text.splitlines() if part in line]

    def close(self):
        self.link.close()

    def _read(self):
        try:
            for raw in self.link:
                packed = raw[16 : 16 + int.from_bytes(raw[8:16], "little")]
                length = int.from_bytes(raw[:8], "little")
                inner = zstandard.ZstdDecompressor().decompress(packed, max_output_size=length)
                for message in msgspec.msgpack.decode(inner)["messages"]:
                    self._take(message)
        except ConnectionClosed:
            return

    def _take(self, message):
        kind = message["type"]
        if kind.startswith("Gui") and "props" in message:
            self.controls[message["uuid"]] = message
        elif kind == "GuiRemoveMessage":
            self.controls.pop(message["uuid"], None)
        elif kind == "GuiUpdateMessage" and message["uuid"] in self.controls:
            here = self.controls[message["uuid"]]
            for key, value in message["updates"].items():
                (here["props"] if key in here["props"] else here)[key] = value
        elif kind == "NotificationShowMessage":
            self.told.append(message["props"]["body"])
        elif kind == "RegisterCommandMessage":
            self.commands[message["props"]["label"]] = message["uuid"]
