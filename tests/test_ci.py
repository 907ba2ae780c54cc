"""The hosted workflow: it runs what .ci/run runs, on what the project says it works with."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

from tests.conftest import QUICK, TESTS

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
SCRIPT = (ROOT / ".ci" / "run").read_text()
STEPS = dict(re.findall(r"^(\w+)\(\) \{.*?\n(.*?)^\}", SCRIPT, flags=re.MULTILINE | re.DOTALL))
"""What the script's functions run, by their names."""


def workflow(name="ci"):
    return yaml.load((ROOT / ".github" / "workflows" / f"{name}.yml").read_text(), yaml.BaseLoader)  # `on` is no bool


def commands(job):
    """Return what a job runs, once for each value of its matrix's steps."""
    runs = [step["run"] for step in job["steps"] if "run" in step]
    chosen = job["strategy"]["matrix"].get("steps", [""])
    return [run.replace("${{ matrix.steps }}", steps) for run in runs for steps in chosen]


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_has_what_each_needs_and_may_only_read(path):
    found = workflow(path.stem)
    assert {"name", "on", "jobs", "permissions"} <= found.keys() and found["permissions"] == {"contents": "read"}
    for job in found["jobs"].values():
        assert {"runs-on", "steps", "timeout-minutes"} <= job.keys()
        assert all(("run" in step) != ("uses" in step) for step in job["steps"])
        assert all(re.fullmatch(r"[\w-]+/[\w-]+@(release/)?v\d+", step["uses"]) for step in job["steps"] if "uses" in step)


def test_only_what_publishes_may_write_and_a_person_approves_a_release():
    jobs = {(path.stem, name): job for path in WORKFLOWS for name, job in workflow(path.stem)["jobs"].items()}
    assert {name for name, job in jobs.items() if "permissions" in job} == {("release", "publish"), ("docs", "publish")}
    assert jobs["release", "publish"]["environment"] == "pypi" and jobs["release", "publish"]["needs"] == "build"
    assert not any("password" in str(job) or "secrets" in str(job) for job in jobs.values())


def test_the_workflow_runs_every_step_of_the_script_and_nothing_else():
    run = [command.split() for job in workflow()["jobs"].values() for command in commands(job)]
    assert run and all(words[0] == ".ci/run" for words in run)
    steps = [step for words in run for step in words[1:]]
    assert sorted(steps) == sorted(STEPS), "each step is one of the script's functions, and stands in one job"


def test_each_job_checks_the_project_out_and_gets_a_python():
    for job in workflow()["jobs"].values():
        assert [step["uses"].split("@")[0] for step in job["steps"][:2]] == ["actions/checkout", "actions/setup-python"]


def test_the_workflow_tests_the_pythons_and_the_torches_that_the_project_says():
    tests = workflow()["jobs"]["tests"]
    said = [each.removeprefix("Programming Language :: Python :: ") for each in PROJECT["classifiers"]]
    assert tests["strategy"]["matrix"]["python"] == [each for each in said if re.fullmatch(r"3\.\d+", each)]
    assert PROJECT["requires-python"] == f">={tests['strategy']['matrix']['python'][0]}"
    lowest, newest = tests["strategy"]["matrix"]["torch"]
    assert f"torch>={lowest.removesuffix('.0')}" in PROJECT["dependencies"] and newest == ""
    assert tests["steps"][-1]["env"] == {"TORCH": "${{ matrix.torch }}"} and '"torch==$TORCH"' in SCRIPT


def test_the_script_lints_checks_types_and_tests_by_default():
    assert "|| set -- lint types tests compile docs\n" in SCRIPT
    assert [STEPS[name].split() for name in ("types", "tests")] == [["mypy"], ["pytest"]]
    bash = shutil.which("bash")
    assert bash is None or subprocess.run([bash, "-n", ROOT / ".ci" / "run"], check=False).returncode == 0


@pytest.mark.parametrize("step", STEPS)
def test_every_tool_of_the_script_comes_with_development(step):
    tools = [line.split()[0] for line in STEPS[step].splitlines() if re.match(r" +[a-z]", line)]
    tools = {{"python3": "", "mkdocs": "mkdocs-material"}.get(tool, tool) for tool in tools} - {""}
    assert tools and tools <= {re.split(r"[>\[]", each)[0] for each in PROJECT["optional-dependencies"]["dev"]}


def test_the_hooks_before_a_commit_run_what_the_script_lints_with():
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"][0]["hooks"]
    linted = [line.split()[0] for name in ("lint", "types") for line in STEPS[name].splitlines()]
    assert {hook["entry"].split()[0] for hook in hooks} == set(linted) == {"ruff", "codespell", "mypy", ".ci/words"}


def words(*arguments):
    """Run the check of docstrings, and return its exit code and what it printed."""
    ran = subprocess.run(
        [sys.executable, ROOT / ".ci" / "words", *arguments], capture_output=True, text=True, check=False
    )
    return ran.returncode, ran.stdout


def test_few_docstrings_have_words_that_are_hard_to_read():
    code, printed = words()
    assert code == 0, printed


@pytest.mark.parametrize(
    ("docstring", "line"),
    [
        ("Return who asks for it.", "module.py:1: who"),
        ("Return the rest,\nto those that go on.", "module.py:1: those that"),
        ("What the module has.", "module.py:1: title is a clause: What the module has."),
    ],
)
def test_words_that_are_hard_to_read_are_found(tmp_path, docstring, line):
    (tmp_path / "module.py").write_text(f'"""{docstring}"""\n')
    code, printed = words(tmp_path)
    assert code == 1 and line in printed.replace(f"{tmp_path}/", "")
    (tmp_path / "module.py").write_text('"""Sum of both shares."""\n\n\ndef told():\n    """Return whose it is."""\n')
    assert words(tmp_path)[0] == 0


def test_codespell_finds_a_mistake_and_none_of_ours(tmp_path):
    codespell = shutil.which("codespell")
    if codespell is None:
        pytest.skip("needs the extra dev")
    ours = subprocess.run([codespell], cwd=ROOT, capture_output=True, text=True, check=False)
    assert ours.returncode == 0, ours.stdout
    (tmp_path / "page.md").write_text("The fire".replace("he", "eh"))
    theirs = subprocess.run([codespell, tmp_path / "page.md"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert theirs.returncode != 0 and "==> The" in theirs.stdout


def test_the_quick_files_are_there():
    assert [each for each in QUICK if not (TESTS / each).exists()] == []
