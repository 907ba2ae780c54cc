"""The command: what it is told, and mistakes in one line."""

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import urlopen

import pytest

from warp_torchrl.commands.failure import MISTAKE, UNSOUND
from warp_torchrl.commands.live import _read, main


def test_the_command_s_own_keys_are_apart_from_those_of_the_scenario():
    given = ["policy=outputs/run", "scenario=large", "seed=7", "port=0", "team.n_agents=3"]
    setting, where, recordings = _read(given)
    assert recordings == Path("recordings") and _read([*given, "recordings=people/one"])[2] == Path("people/one")
    assert (setting.policy, setting.seed, setting.beside) == ("outputs/run", 7, None)
    assert setting.overrides == ("scenario=large", "team.n_agents=3") and where == {"port": 0}
    assert _read(["host=", "token=0123456789"])[1] == {"host": "", "token": "0123456789"}


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["policy=gredy"], "got gredy: did you mean greedy?"),
        (["policy=nowhere/run"], "nowhere/run is not a run folder"),
        (["seed=x"], "seed must be a whole number, got 'x'"),
        (["seed=-1"], "seed must be in"),
        (["port=70000"], "port must be in [0, 65535], got 70000"),
        (["host="], "host must be an address or a name, such as 127.0.0.1, got ''"),
        (["token=abc"], "token must be 8 to 200 letters, digits, - and _, got 3 characters"),
        (["--port", "8080"], "keys are given as port=8080"),
        (["recordings="], "recordings must be a folder, got ''"),
        ([f"recordings={__file__}"], "recordings must be a folder, got the file "),
        (["scenario=larg"], "scenario must be one of"),
        (["team.n_agents=0"], "team.n_agents must be in"),
        (["landscape"], "landscape has no value"),
        (["policy=default", "observation.radius=4"], "the policy default does not fit here"),
        (["scenario=landfire", "policy=local", "landscape.path=nowhere"], "nowhere"),
    ],
)
def test_a_mistake_is_one_line_and_the_exit_code_of_a_mistake(arguments, says, capsys):
    pytest.importorskip("viser", reason="needs the extra live")
    assert main(arguments) in (MISTAKE, UNSOUND)
    out, err = capsys.readouterr()
    *warned, last = err.splitlines()
    assert out == "" and last.startswith("error: ") and says in last
    assert all(each.startswith("warning: other users") for each in warned)


def test_a_port_that_is_taken_is_one_line(capsys):
    pytest.importorskip("viser", reason="needs the extra live")
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        assert main(["policy=noop", f"port={port}"]) == 2
    err = capsys.readouterr().err
    assert err.startswith(f"error: port {port} cannot be used on 127.0.0.1") and len(err.splitlines()) == 1


def test_help_names_the_keys(capsys):
    assert main(["--help"]) == 0
    assert "beside=NAME" in capsys.readouterr().out


@pytest.fixture
def start():
    """Start the page as a command; it is killed at the end."""
    pytest.importorskip("viser", reason="needs the extra live")
    started = []

    def make(*arguments, **variables):
        command = [
            sys.executable,
            "-m",
            "warp_torchrl",
            "live",
            "policy=noop",
            "port=0",
            "landscape.size=12",
            *arguments,
        ]
        started.append(
            subprocess.Popen(
                command,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                env={**os.environ, **variables},
                preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell's background jobs ignore it
            )
        )
        return started[-1]

    yield make
    for each in started:
        each.kill()
        each.communicate()


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_it_prints_its_address_serves_and_ends_with_one_line_by_a_signal(start, number):
    live = start("host=0.0.0.0", WARP_TORCHRL_TOKEN="a-token-of-tests")
    line = live.stdout.readline()
    url = line.split()[0]
    assert url.startswith("http://127.0.0.1:") and url.endswith("/?token=a-token-of-tests")
    assert line.endswith("shows noop; Ctrl-C ends it\n")
    with urlopen(url, timeout=20) as page:
        assert page.status == 200 and b"<html" in page.read().lower()
    with pytest.raises(HTTPError, match="403"):
        urlopen(url.partition("?")[0], timeout=20)
    time.sleep(0.2)
    live.send_signal(number)
    out, err = live.communicate(timeout=30)
    warning, stopped = err.splitlines()
    assert (live.returncode, out, stopped) == (128 + number, "", f"error: stopped by signal {number.name}")
    assert warning.startswith("warning: host=0.0.0.0 opens this page to the network")


@pytest.mark.slow
def test_a_token_of_the_command_line_is_told_to_be_seen_by_others(start):
    live = start("token=a-token-of-tests")
    assert live.stdout.readline().split()[0].endswith("/?token=a-token-of-tests")
    live.terminate()
    assert "other users of this machine can read a command line" in live.communicate(timeout=30)[1]
