"""A mechanic stands apart: without its folder, its values in yaml files and its tests, the rest works as before.

A word of mechanics in the core is found without all of them: the rest of the suite is run. A word of one in another's
code, yaml or tests is found without it alone: all scenarios, options and worlds are made, and those tests are run that
speak of it.
"""

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
OF_ALL = ("tests/test_mechanics_apart.py", "tests/test_docs.py")
"""Tests that no deletion can pass: these, and those of the docs, which show all mechanics."""
CONF = "tests/runs/config/test_conf.py"
OPTIONS = ("option_builds_and_shows_every_field", "scenario_is_a_run", "experiment_is_a_run")
"""Tests of every yaml file, ``test_every_...`` of ``CONF``."""
TRY = """
import pkgutil, importlib, warp_torchrl
from tests.world.mechanics import of_mechanics
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


def test_worlds_of_the_others_are_played():
    for scenario, *overrides in of_mechanics("WORLDS").values():
        make_env(scenario.removeprefix("scenario="), n_worlds=1, overrides=["landscape.size=16", *overrides]).rollout(1)
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
            text = path.read_text()
            rest = re.sub(rf"^mechanics: {{{name}: .*}}\n", "", text, flags=re.MULTILINE)
            if rest != text:
                path.write_text(rest)
        delete_options(copy, f"world.mechanics.{name}.")
        delete_options(copy, f"\n  {name}: {{")  # of scenarios with several
    (copy / "tests" / "test_try.py").write_text(TRY.replace("{names}", repr({*names})).replace("{copy}", str(copy)))
    return copy


def delete_options(copy: Path, text: str) -> None:
    """Delete the options that hold a text, and the scenarios and experiments that choose or follow one of them."""
    options = [*(copy / "conf").rglob("*.yaml"), *(copy / "docs" / "experiment").glob("*.yaml")]
    for path in [each for each in options if text in each.read_text()]:
        path.unlink(missing_ok=True)
        delete_options(copy, f"override /{path.parent.name}: {path.stem}\n")
        delete_options(copy, f"\n  - {path.stem}\n")


def said_of(name: str, copy: Path) -> re.Pattern:
    """Return the words of a mechanic that a copy lacks: its folder, its name, and the options that went with it."""
    went = [path for path in (ROOT / "conf").glob("*/*.yaml") if not (copy / path.relative_to(ROOT)).exists()]
    words = [name, *(f"{each.parent.name}={each.stem}" for each in went)]
    words += [each.stem for each in went if each.parent.name == "scenario"]
    return re.compile(rf"mechanics[./]{name}\b|[\"']({'|'.join(words)})[\"']")


def speaking_of(name: str, copy: Path) -> list[str]:
    """Return the tests of a copy that speak of a mechanic, and all tests of others whose code or tests do.

    Elsewhere only tests that ask what is there can need it: all others pass without any.
    """
    speaks, asks = said_of(name, copy), re.compile("mechanics.there import|import of_mechanics|importorskip")
    rooms = [copy / tree / "world" / "mechanics" for tree in ("warp_torchrl", "tests")]
    others = {path.parent.name for room in rooms for path in room.glob("*/*.py") if speaks.search(path.read_text())}
    found = {f"tests/world/mechanics/{each}" for each in others}
    for path in (copy / "tests").glob("*/**/test_*.py"):
        text = path.read_text()
        if rooms[1] not in path.parents and asks.search(text) and speaks.search(text):
            found.add(str(path.relative_to(copy)))
    return sorted(found - {CONF})


def passes(copy: Path, *tests: str) -> None:
    done = run("-m", "pytest", "-p", "no:cacheprovider", *tests, folder=copy, timeout=7200, PYTHONPATH=str(copy))
    assert done.returncode == 0, done.stdout + done.stderr


def test_files_import_no_mechanic_but_that_of_their_own_folder():
    imports = re.compile(
        rf"^(?:from|import) (?:warp_torchrl|tests)\.world\.mechanics\.({'|'.join(APART)})\b", re.MULTILINE
    )
    found = [
        (str(path), name)
        for path in [*(ROOT / "warp_torchrl").rglob("*.py"), *(ROOT / "tests").rglob("*.py")]
        for name in imports.findall(path.read_text())
        if f"/world/mechanics/{name}/" not in path.as_posix()
    ]
    assert not found


def test_no_word_of_them_is_imported_and_worlds_are_played(tmp_path):
    passes(without(tmp_path, *APART), "-n", "0", "tests/test_try.py", "tests/world/mechanics/test_mechanic.py")


@pytest.mark.slow
def test_the_rest_of_the_suite_passes_without_all(tmp_path):
    passes(without(tmp_path, *APART), "tests", *(f"--ignore={each}" for each in OF_ALL))


@pytest.mark.slow
@pytest.mark.parametrize("name", APART)
def test_what_speaks_of_one_passes_without_it(tmp_path, name):
    copy = without(tmp_path, name)
    options = (f"{CONF}::test_every_{each}" for each in OPTIONS)
    passes(copy, "-n", "0", "tests/test_try.py", *options, *speaking_of(name, copy))
