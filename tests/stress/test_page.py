"""The live page as a command, among browsers that send, leave and do not read as they like."""

import math
import os
import random
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import msgspec
import pytest

pytest.importorskip("viser", reason="needs the extra live")

from websockets.exceptions import ConnectionClosed

from tests.live.browser import CAMERA, Browser, until

pytestmark = pytest.mark.stress
TOKEN = "a-token-of-stress-tests"
KINDS = ("ViewerCameraMessage", "GuiUpdateMessage", "CommandTriggerMessage", "SceneNodeClickMessage", "GuiModalMessage")
MESSAGES, BROWSERS, ROUNDS = 2000, 24, 8


class Served:
    """The command, its address, and what it takes."""

    def __init__(self, folder, *arguments):
        self.folder, self.errors = folder, folder / "stderr"
        command = [
            *(sys.executable, "-m", "warp_torchrl", "live", "policy=skirmish", "port=0", "landscape.size=24"),
            *("team.n_agents=3", "horizon=100000", *arguments),
        ]
        self.process = subprocess.Popen(
            command,
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=self.errors.open("w"),
            text=True,
            env={**os.environ, "OMP_NUM_THREADS": "1", "WARP_TORCHRL_TOKEN": TOKEN},
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )
        self.port = int(re.search(r":(\d+)/", self.process.stdout.readline())[1])

    def browser(self, **options):
        return Browser(self.port, TOKEN, **options)

    def megabytes(self):
        return int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1]) * 4096 / 1e6

    def files(self):
        return len(list(Path(f"/proc/{self.process.pid}/fd").iterdir()))

    def is_well(self):
        """Whether a new browser is served, and the match makes a step for it."""
        visitor = self.browser()
        if "over" in visitor.texts("seed")[0]:
            visitor.press("Restart")
            until(lambda: step(visitor) == 0, 60.0)
        before = step(visitor)
        visitor.press("Step")
        until(lambda: step(visitor) != before, 60.0)
        visitor.close()
        return True


def step(browser):
    return int(re.search(r"step (\d+) of", browser.texts("seed")[0])[1])


@pytest.fixture
def served(tmp_path):
    made = Served(tmp_path)
    yield made
    made.process.kill()
    made.process.communicate()


@pytest.fixture
def ends_well(served):
    """At the end there is no traceback, and Ctrl-C ends the page with one line."""
    yield
    assert served.is_well()
    errors = served.errors.read_text()
    assert "Traceback" not in errors and "never retrieved" not in errors, errors[-3000:]
    served.process.send_signal(signal.SIGINT)
    assert served.process.communicate(timeout=60)[0] == "" and served.process.returncode == 130
    assert served.errors.read_text() == f"{errors}error: stopped by signal SIGINT\n"


def value(draws):
    """Draw a value that somebody may send."""
    simple = (
        *(None, True, False, 0, -1, 1, 7, 60, 2**63, -(2**63), 0.5, -0.0, math.nan, math.inf, 1e300, draws.random()),
        *("", "x", "Play", "Step", "Take over", "extinguish", "../../etc", "<img src=x>", "\x1b[31m", "x" * 20_000),
        b"\0" * 1000,
    )
    kind = draws.randrange(6)
    if kind == 0:
        return [value(draws) for _ in range(draws.randrange(5))]
    if kind == 1:
        return {str(draws.choice(simple))[:30]: value(draws) for _ in range(draws.randrange(4))}
    return draws.choice(simple)


def message(draws, browser):
    """Draw a message: bytes, a message with anything in it, or one that nearly fits."""
    kind = draws.randrange(8)
    if kind == 0:
        return draws.randbytes(draws.randrange(300))
    if kind == 1:
        return "text" * draws.randrange(50)
    if kind == 2:
        changed = dict(CAMERA)
        changed[draws.choice(list(CAMERA))] = value(draws)
        return changed
    if kind == 3:
        names = ("uuid", "updates", "name", "wxyz", "ray_origin", "value")
        return {"type": draws.choice(KINDS), **{each: value(draws) for each in draws.sample(names, 3)}}
    if kind == 4:
        cut = msgspec.msgpack.encode(CAMERA)
        return cut[: draws.randrange(len(cut))]
    if kind == 5:
        ray = [draws.choice((0.0, -1.0, 1e9, 1e-9, math.nan)) for _ in range(3)]
        return {
            **{"type": "SceneNodeClickMessage", "name": "/side_0/tiles", "instance_index": 3, "modifier": None},
            **{"ray_origin": ray, "ray_direction": ray[::-1], "screen_pos": (0.0, 0.0), "owner": ""},
        }
    uuid = draws.choice([*browser.controls, *browser.commands.values(), "none"])
    prop = draws.choice(("value", "value", "value", "options", "visible", "_markdown", "update_cb"))
    return {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {prop: value(draws)}}


@pytest.mark.usefixtures("ends_well")
def test_it_lives_on_thousands_of_messages_of_any_kind(served, capfd):
    draws = random.Random(1)
    witness, one = served.browser(), served.browser()
    ranges = {
        uuid: (each["props"]["min"], each["props"]["max"])
        for uuid, each in witness.controls.items()
        if each["props"].get("max") is not None
    }
    before = served.megabytes()
    for count in range(MESSAGES):
        try:
            one.send(message(draws, one))
        except ConnectionClosed:
            one = served.browser()
        if count % 500 == 499:
            assert served.is_well()
    # Let what it was allowed to start be done, and nothing that it set stand in a new browser.
    until(served.is_well)
    visitor = served.browser()
    for each in visitor.controls.values():
        low, high = each["props"].get("min"), each["props"].get("max")
        if high is not None:
            values = each["value"] if isinstance(each["value"], list) else [each["value"]]
            lows, highs = (side if isinstance(side, list) else [side] for side in (low, high))
            assert all(a <= b <= c for a, b, c in zip(lows, values, highs)), each
        if "options" in each["props"] and each.get("value") is not None:
            assert each["value"] in each["props"]["options"]
    assert ranges and served.megabytes() < before + 150.0
    with capfd.disabled():
        print(f"\n{MESSAGES} messages: {before:.0f} to {served.megabytes():.0f} MB")


@pytest.mark.usefixtures("ends_well")
def test_memory_and_files_stay_as_browsers_come_and_go(served, capfd):
    draws, marks = random.Random(2), []
    for _ in range(ROUNDS):
        there = [served.browser(reads=draws.random() < 0.7) for _ in range(BROWSERS)]
        reading = [each for each in there if each.controls]
        reading[0].press("Play")
        for each in there:
            if draws.random() < 0.3:
                each.link.socket.shutdown(socket.SHUT_RDWR)  # without a word
            elif draws.random() < 0.3:
                each.link.socket.sendall(b"\x82\xff\x00\x00")  # half a frame
        time.sleep(0.5)
        for each in there:
            each.link.socket.close()
        assert served.is_well()
        marks.append((served.megabytes(), served.files()))
    with capfd.disabled():
        print(f"\n{ROUNDS} times {BROWSERS} browsers: MB and files {[(round(a), b) for a, b in marks]}")
    until(lambda: served.files() <= marks[0][1] + 10, 60.0)
    assert max(a for a, _ in marks[2:]) < marks[1][0] * 1.15 + 20.0


@pytest.mark.usefixtures("ends_well")
def test_a_flood_and_one_who_never_reads_do_not_stop_the_others(served):
    witness, flood, sleeper = served.browser(), served.browser(), served.browser(reads=False)
    witness.set("Steps a second", 30)
    witness.press("Play")
    began = step(witness)
    end = time.monotonic() + 15.0
    sent = 0
    while time.monotonic() < end:
        for _ in range(50):
            flood.press("Play")
            flood.send(b"\xc1")
        sent += 100
        time.sleep(0.05)
    assert sent > 3000 and step(witness) - began > 15
    witness.set("Seed", -5)
    until(lambda: any("Seed must be" in each for each in witness.told), 20.0)
    sleeper.link.socket.close()


@pytest.mark.usefixtures("ends_well")
def test_strangers_without_the_token_get_nothing_and_hold_up_nobody(served):
    witness, links = served.browser(), []
    for at in range(400):
        links.append(socket.create_connection(("127.0.0.1", served.port)))
        links[-1].sendall(random.Random(at).randbytes(200) if at % 2 else b"GET / HTTP/1.1\r\nHost: 127")
        if at % 2:
            links[-1].close()
    witness.press("Step")
    until(lambda: step(witness) > 0)
    assert served.files() < 400
    for each in links:
        each.close()
    until(lambda: served.files() < 60, 60.0)
    assert served.errors.read_text() == ""
