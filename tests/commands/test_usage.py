"""The help of train and evaluate, and the command that tells what keys mean."""

import sys

import pytest

from warp_torchrl.commands.command import evaluate, train
from warp_torchrl.commands.usage import keys_help, main
from warp_torchrl.runs.config.construction import COMPONENTS
from warp_torchrl.world.mechanics.table import mechanics


def told(monkeypatch, capsys, command, *words):
    monkeypatch.setattr(sys, "argv", ["train.py", *words])
    with pytest.raises(SystemExit) as end:
        command()
    return end.value.code, capsys.readouterr()


def test_help_has_the_keys_of_the_options_that_are_chosen(monkeypatch, capsys):
    code, said = told(monkeypatch, capsys, train, "--help", "algorithm=dqn", "n_worlds=7")
    assert code == 0 and said.out.startswith("usage: warp train [KEY=VALUE ...]\n")
    lines = said.out.splitlines()
    assert "  n_worlds=7" in lines and lines[lines.index("  n_worlds=7") + 1] == "      Worlds in the batch."
    assert "  algorithm.epsilon_end=0.05" in lines and not any("algorithm.clip_epsilon" in line for line in lines)
    assert all(any(line.startswith(f"{group}={{") for line in lines) for group in (*COMPONENTS, "scenario"))
    assert all(any(line.startswith(f"  mechanics.{name}.") for line in lines) for name in mechanics())


def test_a_mistake_beside_it_is_told(monkeypatch, capsys):
    code, said = told(monkeypatch, capsys, train, "-h", "n_wrlds=7")
    assert code == 2 and said.err == "error: n_wrlds is not a key of the configuration: did you mean n_worlds?\n"


def test_that_of_evaluate_has_its_own_keys(monkeypatch, capsys):
    code, said = told(monkeypatch, capsys, evaluate, "--help")
    lines = said.out.splitlines()
    assert code == 0 and lines[lines.index("  checkpoint=null") + 1].startswith("      a run folder")


def test_keys_of_a_group_are_those_of_each_option(capsys):
    assert main(["wind"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert (
        "wind=calm: No wind." in lines
        and "  wind.speed=4" in lines
        and not any(each.startswith("  fire.") for each in lines)
    )
    said = keys_help(["mechanics"])
    assert all(f"mechanics.{name}: " in said for name in mechanics())


def test_a_group_that_is_not_there_is_told(capsys):
    assert main(["wnd"]) == 2
    assert capsys.readouterr().err.endswith(", got wnd: did you mean wind?\n")
