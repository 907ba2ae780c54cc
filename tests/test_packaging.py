"""What an installation has: the wheel's files, and its programs."""

import importlib
import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built without a network."""
    pytest.importorskip("hatchling", reason="needs the extra dev")
    from hatchling.builders.wheel import WheelBuilder

    folder = tmp_path_factory.mktemp("wheel")
    return Path(next(WheelBuilder(str(ROOT)).build(directory=str(folder), versions=["standard"])))


def test_the_wheel_has_every_module_and_every_option(wheel):
    files = set(ZipFile(wheel).namelist())
    package = [path for path in (ROOT / "warp_torchrl").rglob("*") if path.suffix == ".py" or path.name == "py.typed"]
    options = list((ROOT / "conf").rglob("*.yaml"))
    assert {path.relative_to(ROOT).as_posix() for path in package} <= files
    assert {f"warp_torchrl/{path.relative_to(ROOT).as_posix()}" for path in options} <= files and len(options) > 50
    policies = [path for path in (ROOT / "docs" / "policies").rglob("*") if path.is_file()]
    assert {f"warp_torchrl/{path.relative_to(ROOT / 'docs').as_posix()}" for path in policies} <= files and policies
    assert not [name for name in files if not name.startswith(("warp_torchrl/", "warp_torchrl-"))]


def test_a_wheel_can_be_built_from_the_source_distribution(tmp_path):
    pytest.importorskip("hatchling", reason="needs the extra dev")
    from hatchling.builders.sdist import SdistBuilder

    path = next(SdistBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"]))
    with tarfile.open(path) as archive:
        files = {name.partition("/")[2] for name in archive.getnames()}
    wheel = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    for folder in (*wheel["packages"], *wheel["force-include"]):
        needed = [each for each in (ROOT / folder).rglob("*") if each.is_file() and "__pycache__" not in each.parts]
        assert {each.relative_to(ROOT).as_posix() for each in needed} <= files and needed


@pytest.mark.slow
def test_the_wheel_runs_from_any_folder(wheel, tmp_path):
    ZipFile(wheel).extractall(tmp_path / "installed")
    (tmp_path / "empty").mkdir()
    code = "import warp_torchrl as w; print(w.__file__)\n"
    code += "for policy in (w.load_policy(name) for name in ('default', 'single', 'skirmish')):\n"
    code += "    env = w.make_env('default', n_worlds=2, overrides=policy.overrides)\n"
    code += "    print(tuple(env.rollout(3, policy).shape))"
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path / "empty",
        env={**os.environ, "PYTHONPATH": str(tmp_path / "installed")},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [str(tmp_path / "installed" / "warp_torchrl" / "__init__.py"), *["(2, 3)"] * 3]


TINY = (
    *("landscape.size=12", "horizon=16", "n_worlds=4", "processes=1", "collector.steps=8", "total_frames=32"),
    *("algorithm.minibatch_size=32", "model.actor_hidden=[8]", "model.critic_hidden=[8]", "evaluation.episodes=2"),
)


@pytest.mark.slow
def test_the_template_of_a_plug_in_runs_beside_the_wheel(wheel, tmp_path):
    ZipFile(wheel).extractall(tmp_path / "installed")
    folder, warp = tmp_path / "lab", tmp_path / "warp"  # the program's folder, which Python searches, is not the lab's
    warp.write_text("import sys\nfrom warp_torchrl.__main__ import main\nsys.exit(main())\n")
    shutil.copytree(ROOT / "docs" / "examples" / "my_lab", folder)

    def run(*command):
        return subprocess.run(
            [sys.executable, *command],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(tmp_path / "installed"), "OMP_NUM_THREADS": "1"},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )

    lab, gap = "plugins=[my_lab]", ("scenario=gap", "algorithm=surrogate", "evaluation.baselines=[sentry]")
    for command in (
        ("-m", "pytest", "-q", "-p", "no:cacheprovider"),
        (warp, "train", lab, *gap, *TINY, "hydra.run.dir=run"),
        (warp, "train", lab, "resume=run", "total_frames=64"),
        (warp, "evaluate", lab, "checkpoint=run", "evaluation.episodes=2", "picture=null"),
        (warp, "export", "run", "mine", lab),
        ("-c", "import warp_torchrl; warp_torchrl.load_policy('mine', plugins=['my_lab'])"),
    ):
        done = run(*map(str, command))
        assert done.returncode == 0, (command, done.stderr)
    for command in (("train", "resume=run"), ("export", "run", "other")):
        done = run(str(warp), *command)
        assert done.returncode == 2 and "error: plugins=[my_lab] must be given" in done.stderr, done.stderr


@pytest.mark.parametrize("name", PROJECT["scripts"])
def test_a_program_s_function_is_there(name):
    module, _, function = PROJECT["scripts"][name].partition(":")
    assert callable(getattr(importlib.import_module(module), function))


@pytest.mark.parametrize(
    "extra",
    ["gis", "netcdf", "calibration", "tensorboard", "figures", "interop", "docs", "search", "sweep", "live", "video"],
)
def test_development_has_what_each_extra_has(extra):
    extras = PROJECT["optional-dependencies"]
    assert set(extras[extra]) <= set(extras["dev"])
