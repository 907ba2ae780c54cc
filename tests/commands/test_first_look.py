"""The first look: mistakes are told without torch, in the command's own words, and nothing else is."""

import json
import subprocess
import sys
from functools import cache

import pytest
import yaml

from tests.stress.processes import ROOT
from warp_torchrl.commands import predict
from warp_torchrl.commands.command import evaluate, train
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import GROUPS, compose_config, conf_folder, option_names
from warp_torchrl.runs.config.construction import COMPONENTS, ConfigError, component
from warp_torchrl.runs.config.defaults import UNKNOWN, defaults
from warp_torchrl.runs.config.plain_values import plain

MISTAKES = (
    "train total_frame=3",
    "evaluate policyy=x",
    "train algorithm=mapo",
    "train algorithm.n_step=4",
    "train n_worlds=-1",
    "train horizon=0",
    "train team.n_agents=0",
    "predict hours=-3 weather=w.csv ignition=i.csv",
)
OTHERS = ("predict hour=3", "train n_worlds=abc", "train checkpoint.keep=1", "train debog=true", "evaluate seed=3")
"""Mistakes each of a kind that ``MISTAKES`` has."""
TELL = """
import contextlib, io, json, sys
from warp_torchrl.__main__ import main
told = []
for line in sys.argv[1:]:
    sys.argv = ["warp", *line.split()]
    with contextlib.redirect_stderr(io.StringIO()) as errors:
        try:
            code = main()
        except SystemExit as end:
            code = end.code
    told.append((code, errors.getvalue(), sorted({"torch", "torchrl", "tensordict"} & sys.modules.keys())))
print(json.dumps(told))
"""


def python(code, *arguments):
    """Run a program in a process that has imported nothing."""
    return subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, cwd=ROOT)


@cache
def first_told(mistakes):
    """Exit code, line and libraries of each mistake, in a process that has imported nothing."""
    return dict(zip(mistakes, json.loads(python(TELL, *mistakes).stdout), strict=True))


def told_by_command(line, monkeypatch, capsys):
    """What the command itself says, without a first look."""
    name, *arguments = line.split()
    monkeypatch.setattr(sys, "argv", ["warp", *arguments])
    if name == "predict":
        assert predict.main() == 2
    else:
        with pytest.raises(SystemExit) as end:
            {"train": train, "evaluate": evaluate}[name]()
        assert end.value.code == 2
    return capsys.readouterr().err


@pytest.mark.parametrize("line", [*MISTAKES, *(pytest.param(each, marks=pytest.mark.slow) for each in OTHERS)])
def test_a_mistake_is_told_without_torch_as_the_command_tells_it(line, monkeypatch, capsys):
    code, told, libraries = first_told(MISTAKES if line in MISTAKES else OTHERS)[line]
    assert (code, libraries) == (2, [])
    assert told == told_by_command(line, monkeypatch, capsys)


def test_flags_plugins_and_tracebacks_are_left_to_the_command():
    left = (["-m", "seed=x"], ["plugins=[none]", "seed=x"], ["debug=true", "seed=x"], ["seed"], [])
    look = f"from warp_torchrl.commands.first_look import first_look\nfor each in {left}: first_look('train', each)"
    assert python(look).returncode == 0


FIELDS = """
import json, sys
from warp_torchrl.runs.config.construction import by_excerpts, component
from warp_torchrl.runs.config.defaults import defaults
with by_excerpts():
    print(json.dumps({target: defaults(component(target)) for target in sys.argv[1:]}))
assert "torch" not in sys.modules
"""
OTHERS = (
    "warp_torchrl.runs.config.run_config.RunConfig",
    "warp_torchrl.runs.config.options.PredictionOptions",
    "warp_torchrl.runs.config.options.SearchOptions",
)


def test_excerpts_of_components_have_the_fields_and_defaults_of_the_classes():
    files = [path for group in COMPONENTS for path in (conf_folder() / group).glob("*.yaml")]
    named = {yaml.safe_load(path.read_text()).get("_target_") for path in files}
    targets = sorted({*OTHERS, *named} - {None})
    assert len(targets) > 40
    found = json.loads(python(FIELDS, *targets).stdout)
    for target in targets:
        own = json.loads(json.dumps(defaults(component(target))))
        assert list(found[target]) == list(own), target
        assert not {key for key, value in found[target].items() if value not in (own[key], UNKNOWN)}, target


ALL = """
import sys
from warp_torchrl.commands import first_look as looks
for option in sys.argv[1:]:
    try:
        looks.first_look("train", [option])
    except SystemExit:
        print(option)
assert "torch" not in sys.modules
"""


@pytest.mark.slow
def test_what_is_right_is_not_called_a_mistake():
    options = [f"{group}={name}" for group in (*GROUPS, *COMPONENTS) for name in option_names(group)]
    refused = python(ALL, *options).stdout.split()
    for option in options:
        try:
            run_config(plain(compose_config("train", [option])))
        except ConfigError:
            continue  # which the first look may see
        assert option not in refused
