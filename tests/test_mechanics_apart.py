"""A mechanic stands apart: without its folder, its values in yaml files and its tests, the rest works as before."""

import re
import shutil
from pathlib import Path

import pytest

from tests.test_docs import ROOT, run

APART = (
    *("agencies", "arrivals", "belief", "breach", "drops", "embers", "flight", "lines", "radio", "retardant"),
    *("sensing", "values"),
)
"""Mechanics whose folder can be deleted."""
TRY = """
import pkgutil, importlib, warp_torchrl
from warp_torchrl import make_env
from warp_torchrl.runs.config.compose import conf_folder
from warp_torchrl.world.mechanics.table import kinds


def test_no_word_of_it_is_imported():
    assert warp_torchrl.__path__ == ["{copy}/warp_torchrl"], "what is tested is the copy"
    for each in pkgutil.walk_packages(warp_torchrl.__path__, "warp_torchrl."):
        if each.name.split(".")[1] in ("env", "evaluation", "heuristics", "models", "runs", "training", "world"):
            importlib.import_module(each.name)
    assert not {names} & {each.name for each in kinds()}, "they are deleted"


def test_worlds_are_played():
    scenarios = {path.stem for path in (conf_folder() / "scenario").glob("*.yaml")}
    for scenario in sorted({"default", "hetero", "front", "agencies", "search", "haksar"} & scenarios):
        make_env(scenario, n_worlds=2, overrides=["landscape.size=16"]).rollout(3)
"""
"""Tests of the copy, in one process with those that it has."""


def without(folder: Path, *names: str) -> Path:
    """Return a copy of the project without some mechanics."""
    copy = folder / "project"
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns("__pycache__", ".git", "outputs", ".*_cache"))
    for name in names:
        for tree in ("warp_torchrl", "tests"):
            shutil.rmtree(copy / tree / "world" / "mechanics" / name)
        for path in (copy / "conf").rglob("*.yaml"):
            path.write_text(re.sub(rf"^mechanics: {{{name}: .*}}\n", "", path.read_text(), flags=re.MULTILINE))
        delete_options(copy, f"world.mechanics.{name}.")
        delete_options(copy, f"\n  {name}: {{")  # of scenarios with several
    return copy


def delete_options(copy: Path, text: str) -> None:
    """Delete the options that hold a text, and the scenarios and experiments that choose or follow one of them."""
    options = [*(copy / "conf").rglob("*.yaml"), *(copy / "docs" / "experiment").glob("*.yaml")]
    for path in [each for each in options if text in each.read_text()]:
        path.unlink(missing_ok=True)
        delete_options(copy, f"override /{path.parent.name}: {path.stem}\n")
        delete_options(copy, f"\n  - {path.stem}\n")


def passes(copy: Path, processes: str, *tests: str) -> None:
    command = ("-m", "pytest", "-n", processes, "-p", "no:cacheprovider", *tests)
    done = run(*command, folder=copy, PYTHONPATH=str(copy))
    assert done.returncode == 0, done.stdout + done.stderr


def test_no_word_of_them_is_imported_and_worlds_are_played(tmp_path):
    copy = without(tmp_path, *APART)
    tried = TRY.replace("{names}", repr(set(APART))).replace("{copy}", str(copy))
    (copy / "tests" / "test_try.py").write_text(tried)
    passes(copy, "0", "tests/test_try.py", "tests/test_architecture.py", "tests/world/mechanics/test_mechanic.py")


@pytest.mark.slow
@pytest.mark.parametrize("name", APART)
@pytest.mark.parametrize("room", ["world", "env", "heuristics", "evaluation", "models", "runs", "training"])
def test_the_rest_of_the_suite_passes(tmp_path, name, room):
    passes(without(tmp_path, name), "2", f"tests/{room}")
