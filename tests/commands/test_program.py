"""Entry and exit of the commands."""

import os
import signal
import subprocess
import sys

import pytest

from tests.stress.processes import ROOT, catches, wait_for
from warp_torchrl.commands.program import one_line_end, run_program
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.system.interruption import is_command


def test_help_is_printed_and_nothing_is_done(capsys):
    assert run_program(["seed=1", "--help"], "how to use it", lambda given: pytest.fail("it was done")) == 0
    assert capsys.readouterr().out == "how to use it\n"


@pytest.mark.parametrize(("code", "expected"), [(None, 0), (0, 0), (4, 4)])
def test_the_exit_code_is_what_was_done_returned(code, expected):
    assert run_program(["seed=1"], "", lambda given: code) == expected


def test_a_mistake_is_one_line_and_an_exit_code(capsys):
    def do(given):
        raise ConfigError(f"{given[0]} is wrong,\nand this says why")

    assert run_program(["seed=1"], "", do) == 2
    assert capsys.readouterr().err == "error: seed=1 is wrong, and this says why\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_one_line_and_an_exit_code_whatever_a_library_makes_of_it(number, capfd):
    def do(given):
        try:
            os.kill(os.getpid(), number)
        finally:
            raise RuntimeError("Converting a tensordict to boolean value is not permitted")  # as its `with` does

    assert run_program([], "", do) == 128 + number
    assert capfd.readouterr().err == f"error: stopped by signal {number.name}\n"
    with pytest.raises(SystemExit) as end, one_line_end():
        do([])
    assert end.value.code == 128 + number and capfd.readouterr().err.count("\n") == 1


def test_an_error_of_a_command_with_flags_is_one_line_and_an_exit_code(capsys):
    with pytest.raises(SystemExit) as end, one_line_end():
        raise ConfigError("this is\nwrong")
    assert end.value.code == 2 and capsys.readouterr().err == "error: this is wrong\n"


@pytest.mark.parametrize("program", [["-m", "warp_torchrl", "predict"], [str(ROOT / "train.py"), "total_frames=64"]])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_command_that_still_imports_ends_with_one_line(tmp_path, program, number):
    process = subprocess.Popen(
        [sys.executable, *program],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stderr=subprocess.PIPE,
        text=True,
    )
    wait_for(lambda: catches(process, signal.SIGTERM), process)
    process.send_signal(number)
    _, errors = process.communicate(timeout=30)
    assert (process.returncode, errors) == (128 + number, f"error: stopped by signal {number.name}\n")
    assert not list(tmp_path.iterdir())


def test_the_worker_of_a_command_is_no_command(monkeypatch):
    train = str(ROOT / "train.py")
    monkeypatch.setattr(sys, "argv", [train, "seed=1"])
    monkeypatch.setattr(sys, "orig_argv", ["python", train, "seed=1"])
    assert is_command()
    monkeypatch.setattr(sys, "orig_argv", ["python", "-c", "from multiprocessing.spawn import ...", "--fork"])
    assert not is_command()
    monkeypatch.setattr(sys, "argv", ["-m", "seed=1"])
    for module, is_ours in (("warp_torchrl.live", True), ("warp_torchrl_else", False), ("pytest", False)):
        monkeypatch.setattr(sys, "orig_argv", ["python", "-m", module, "seed=1"])
        assert is_command() == is_ours


def test_what_an_error_quotes_rings_no_bell_and_is_no_page_long(capsys):
    def do(given):
        raise ConfigError("policy \x1b]0;owned\x07\x1b[31mred\x9b2J is none of " + "a" * 100_000)

    assert run_program([], "", do) == 2
    line = capsys.readouterr().err
    assert line.startswith("error: policy red is none of aaa")
    assert line.rstrip("\n").isprintable() and len(line) < 4100
