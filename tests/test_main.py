"""The one command line: its commands, its help, and what it says of mistakes."""

import sys
from importlib import import_module

import pytest

from warp_torchrl.__main__ import COMMANDS, main


def run(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["warp", *words])
    return main()


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_is_a_function_with_its_purpose_in_the_help(name, monkeypatch, capsys):
    module, _, function = COMMANDS[name][0].partition(":")
    assert callable(getattr(import_module(module), function))
    assert run(monkeypatch, "--help") == 0
    assert f"  {name}  " in (told := capsys.readouterr().out) and COMMANDS[name][1] in told


def test_without_a_command_it_tells_its_commands(monkeypatch, capsys):
    assert run(monkeypatch) == 2 and "summary" in capsys.readouterr().out


def test_a_command_gets_what_stands_behind_its_name(monkeypatch, capsys, tmp_path):
    with pytest.raises(SystemExit) as end:
        run(monkeypatch, "summary", str(tmp_path))
    assert end.value.code == 2
    assert capsys.readouterr().err == f"error: no evaluation.json under {tmp_path}\n"


def test_an_unknown_command_is_told_in_one_line(monkeypatch, capsys):
    assert run(monkeypatch, "preditc\x1b[31m") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: the command must be one of train,") and line.isprintable()
    assert run(monkeypatch, "preditc") == 2
    assert capsys.readouterr().err.endswith("did you mean predict?\n")
