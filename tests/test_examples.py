"""The worked examples of docs/examples run as scripts, for a few steps."""

import re
import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parent.parent / "docs" / "examples"
PEERS = EXAMPLES.parent / "peers"
QUICK = {"pettingzoo_round_trip", "frame_stack_torchrl", "training_loop"}
CASES = {  # packages that it needs, steps, what it prints
    "training_loop": ((), 1024, r"1024 steps, \d+\.\d% of the trees saved"),
    "supersuit_sb3_ppo": (("supersuit", "stable_baselines3"), 1024, r"1024 agent steps, \d+\.\d% of the trees saved"),
    "sb3_dqn": (("stable_baselines3",), 100, r"100 steps, \d+\.\d% of the trees saved"),
    "pettingzoo_round_trip": ((), 40, "40 steps, the same rewards: True"),
    "frame_stack_torchrl": ((), 256, r"views \[16, 2, 44, 7, 7\], \d\.\d\d nats of entropy left"),
    "frame_stack_supersuit": (("supersuit", "stable_baselines3"), 1024, "147 numbers became 588; 1024 agent steps"),
    "tianshou_dqn": (("tianshou",), 128, "128 turns"),
    "rllib_ppo": (("ray.rllib",), 256, "256 world steps"),
    "benchmarl_task": (("benchmarl",), 512, "512 world steps"),
}
SMALLER = {"training_loop": ["--worlds", "4"]}


def test_every_example_is_run():
    assert {path.stem for path in EXAMPLES.glob("*.py")} == set(CASES)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in QUICK else pytest.mark.slow) for name in CASES]
)
def test_an_example_runs(name, tmp_path, monkeypatch, capsys):
    packages, steps, says = CASES[name]
    for package in packages:
        pytest.importorskip(package, reason=f"{name}.py needs {package}")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [f"{name}.py", "--steps", str(steps), *SMALLER.get(name, [])])
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    last = capsys.readouterr().out.strip().splitlines()[-1]
    assert re.fullmatch(says, last), last


@pytest.mark.slow
@pytest.mark.parametrize(("name", "package"), [("with_sb3", "sb3_contrib"), ("with_benchmarl", "benchmarl")])
def test_a_peer_trains_and_plays_the_fires(name, package, tmp_path, monkeypatch, capsys):
    pytest.importorskip(package, reason=f"{name}.py needs {package}")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(PEERS)
    monkeypatch.setattr(sys, "argv", [f"{name}.py", "--minutes", "0.01", "--worlds", "4"])
    runpy.run_path(str(PEERS / f"{name}.py"), run_name="__main__")
    last = capsys.readouterr().out.strip().splitlines()[-1]
    assert re.fullmatch(r"\d+ world steps in 0.01 minutes: \d+\.\d \+- \d\.\d % saved", last), last


def test_the_training_loop_is_60_lines_that_know_the_environment_alone():
    source = (EXAMPLES / "training_loop.py").read_text()
    assert len(source.splitlines()) <= 60
    assert re.findall(r"^.*\bwarp_torchrl\b.*$", source, flags=re.MULTILINE) == ["from warp_torchrl import make_env"]
