"""A mechanic stands apart: without its folder, its values in yaml files and its tests, the rest works as before."""

import re
import shutil
from pathlib import Path

import pytest

from tests.test_docs import ROOT, run

APART = ("flight", "retardant")
"""Mechanics whose folder can be deleted."""
WHOLE = ("flight",)
"""Those whose tests all stand in their folder, so that the rest of the suite passes too."""
TRY = """
import pkgutil, importlib, warp_torchrl
from warp_torchrl import make_env
from warp_torchrl.world.mechanics.table import mechanics

SCENARIOS = ("default", "hetero", "front", "agencies", "search", *(["haksar"] if "{name}" != "retardant" else []))


def test_no_word_of_it_is_imported():
    assert warp_torchrl.__path__ == ["{copy}/warp_torchrl"], "what is tested is the copy"
    for each in pkgutil.walk_packages(warp_torchrl.__path__, "warp_torchrl."):
        if each.name.split(".")[1] in ("env", "evaluation", "heuristics", "models", "runs", "training", "world"):
            importlib.import_module(each.name)
    assert "{name}" not in mechanics(), "it is deleted"


def test_worlds_are_played():
    for scenario in SCENARIOS:
        make_env(scenario, n_worlds=2, overrides=["landscape.size=16"]).rollout(3)
"""
"""Tests of the copy, in one process with those that it has."""


@pytest.fixture(scope="module", params=APART)
def without(request, tmp_path_factory):
    """A copy of the project without a mechanic, and its name."""
    name, copy = request.param, tmp_path_factory.mktemp("without") / "project"
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns("__pycache__", ".git", "outputs", ".*_cache"))
    for tree in ("warp_torchrl", "tests"):
        shutil.rmtree(copy / tree / "world" / "mechanics" / name)
    for path in (copy / "conf").rglob("*.yaml"):
        path.write_text(re.sub(rf"^mechanics: {{{name}: .*}}\n", "", path.read_text(), flags=re.MULTILINE))
    delete_options(copy / "conf", f"world.mechanics.{name}.")
    return name, copy


def delete_options(conf: Path, text: str) -> None:
    """Delete the options that hold a text, and the scenarios and experiments that choose one of them."""
    for path in [each for each in conf.rglob("*.yaml") if text in each.read_text()]:
        path.unlink(missing_ok=True)
        delete_options(conf, f"override /{path.parent.name}: {path.stem}\n")


def passes(copy: Path, processes: str, *tests: str) -> None:
    command = ("-m", "pytest", "-n", processes, "-p", "no:cacheprovider", *tests)
    done = run(*command, folder=copy, PYTHONPATH=str(copy))
    assert done.returncode == 0, done.stdout + done.stderr


def test_no_word_of_it_is_imported_and_worlds_are_played(without):
    name, copy = without
    (copy / "tests" / "test_try.py").write_text(TRY.replace("{name}", name).replace("{copy}", str(copy)))
    passes(copy, "0", "tests/test_try.py", "tests/test_architecture.py", "tests/world/mechanics/test_mechanic.py")


@pytest.mark.slow
@pytest.mark.parametrize("room", ["world", "env", "heuristics", "evaluation", "models", "runs", "training"])
def test_the_rest_of_the_suite_passes(without, room):
    name, copy = without
    if name not in WHOLE:
        pytest.skip(f"tests elsewhere play in worlds of {name}")
    passes(copy, "2", f"tests/{room}")
