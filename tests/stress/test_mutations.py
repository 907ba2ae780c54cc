"""Checkpoints and recordings that were flipped, cut, zeroed, lengthened, swapped or thinned: all are noticed."""

import json
import pickle
import random
import shutil

import pytest
import torch

from tests.forgery import forge
from tests.stress.saves import KINDS
from tests.training.test_loop import tiny
from warp_torchrl import load_policy
from warp_torchrl.commands.command import evaluate
from warp_torchrl.demonstrations.files import MANIFEST, find_recordings, read_recording
from warp_torchrl.demonstrations.replay import Replay
from warp_torchrl.runs.checkpoint import CheckpointError, newest
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.system.checksummed import Unsound, checksummed, described

pytestmark = pytest.mark.stress
MUTATIONS = 200
FILES = ("policy.pt", "training.pt", "config.json", "manifest.json")


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    run = tmp_path_factory.mktemp("trained")
    tiny(run, "evaluation.mode=sampled", "total_frames=128").train()
    return run


def mutate(folder, other, draws, files=FILES):
    """Harm one file of what was saved, and say how; ``other`` is a sound one."""
    name, harm = draws.choice(files), draws.choice(("flip", "cut", "zero", "append", "swap", "delete"))
    path = folder / name
    content = path.read_bytes()
    place = draws.randrange(len(content))
    if harm == "delete":
        path.unlink()
    elif harm == "swap":
        twin = draws.choice([folder / each for each in files if each != name] + [other / name])
        changed = twin.read_bytes()
        if changed == content:
            return mutate(folder, other, draws, files)
        twin.parent == folder and twin.write_bytes(content)
        path.write_bytes(changed)
    else:
        length = draws.randrange(1, 64)
        flipped = bytes([content[place] ^ (1 << draws.randrange(8))])
        changed = {
            "flip": content[:place] + flipped + content[place + 1 :],
            "cut": content[:place],
            "zero": content[:place] + bytes(length) + content[place + length :],
            "append": content + draws.choice((b" ", b"\n", b"\0", draws.randbytes(length))),
        }[harm]
        if changed == content:
            return mutate(folder, other, draws, files)
        path.write_bytes(changed)
    return f"{harm} {name}"


def test_every_mutation_is_noticed(trained, tmp_path, monkeypatch, capfd):
    caught, monkey = 0, random.Random(8)
    for number in range(MUTATIONS):
        run = tmp_path / "run"
        shutil.rmtree(run, ignore_errors=True)
        shutil.copytree(trained, run)
        newer, older = (run / "checkpoints" / frames for frames in ("128", "64"))
        what = mutate(newer, older, monkey)
        found, skipped = newest(run)
        assert found.path == older and len(skipped) == 1 and "\n" not in skipped[0], what
        with pytest.raises(CheckpointError) as error:
            load_policy(newer)
        assert "\n" not in str(error.value)
        if number % 20 == 0:
            monkeypatch.chdir(tmp_path)
            monkeypatch.setattr("sys.argv", ["evaluate.py", f"checkpoint={newer}"])
            with pytest.raises(SystemExit) as end:
                evaluate()
            (line,) = capfd.readouterr().err.strip().splitlines()
            assert end.value.code == 4 and line.startswith("error: ")
        caught += 1
    with capfd.disabled():
        print(f"\nmutations caught / tried: {caught} / {MUTATIONS}")


def test_no_forgery_is_more_than_an_error_in_one_line(trained, tmp_path):
    """Mutated, then sealed again: whoever made it knows the format. Nothing runs, nothing ends in a traceback."""
    monkey, refused, harmless = random.Random(9), 0, 0
    for _ in range(MUTATIONS):
        run = tmp_path / "run"
        shutil.rmtree(run, ignore_errors=True)
        shutil.copytree(trained, run)
        newer, older = (run / "checkpoints" / frames for frames in ("128", "64"))
        what = mutate(newer, older, monkey)
        try:
            forge(newer)
        except (OSError, ValueError, KeyError):
            continue  # the manifest itself is gone
        try:
            load_policy(newer)
            tiny(tmp_path / "resumed", "evaluation.mode=sampled", "total_frames=128").load_state_dict(
                newest(newer)[0].training()
            )
            harmless += 1
        except (CheckpointError, ConfigError) as error:
            assert "\n" not in str(error), what
            refused += 1
    print(f"\nforgeries refused: {refused}, read as what they say: {harmless}, tracebacks: 0")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    people = tmp_path_factory.mktemp("recorded")
    for number in (1, 2):
        KINDS["recording"].save(people, number)
    return people


def harmed(recorded, people, draws):
    """Copy two recordings, and harm one; return it, its files and how it was harmed."""
    shutil.rmtree(people, ignore_errors=True)
    shutil.copytree(recorded, people)
    folder, other = (KINDS["recording"].result(people, number) for number in (1, 2))
    files = [str(path.relative_to(folder)) for path in KINDS["recording"].files(people, 1)]
    return folder, mutate(folder, other, draws, files)


def test_every_mutation_of_a_recording_is_noticed(recorded, tmp_path):
    draws = random.Random(8)
    for _ in range(MUTATIONS):
        folder, what = harmed(recorded, tmp_path / "people", draws)
        if what == f"delete {MANIFEST}":
            assert folder not in find_recordings(tmp_path / "people")
            continue
        with pytest.raises(Unsound) as error:
            read_recording(folder)
        assert "\n" not in str(error.value), what
    print(f"\nmutations of recordings caught / tried: {MUTATIONS} / {MUTATIONS}")


def test_no_forged_recording_is_more_than_an_error_in_one_line(recorded, tmp_path):
    draws, refused, harmless = random.Random(9), 0, 0
    for _ in range(MUTATIONS):
        folder, what = harmed(recorded, tmp_path / "people", draws)
        try:
            content = json.loads((folder / MANIFEST).read_text())
            content.pop("sha256")
            content["files"] |= described(folder, [each for each in content["files"] if (folder / each).exists()])
            (folder / MANIFEST).write_bytes(checksummed(content))
        except (OSError, ValueError, KeyError):
            continue  # the manifest itself is gone
        try:
            Replay(read_recording(folder)).check()
            harmless += 1
        except (Unsound, ConfigError) as error:
            assert "\n" not in str(error), what
            refused += 1
    print(f"\nforged recordings refused: {refused}, play as what they say: {harmless}, tracebacks: 0")
    assert refused > MUTATIONS / 2


class Poison:
    def __init__(self, canary):
        self.canary = canary

    def __reduce__(self):
        return (open, (str(self.canary), "w"))


@pytest.mark.parametrize("name", FILES)
def test_a_poisoned_file_touches_nothing(trained, tmp_path, monkeypatch, capfd, name):
    run, canary = tmp_path / "run", tmp_path / "canary"
    shutil.copytree(trained, run)
    for folder in (run / "checkpoints").iterdir():
        content = torch.load(folder / name, weights_only=True) if name.endswith(".pt") else {}
        torch.save({**content, "poison": Poison(canary)}, folder / name) if content else (folder / name).write_bytes(
            pickle.dumps(Poison(canary))
        )
        name == "manifest.json" or forge(folder)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["evaluate.py", f"checkpoint={run}"])
    with pytest.raises(CheckpointError):
        found = newest(run)[0]
        found.training(), load_policy(run)
    if name != "training.pt":  # which evaluation does not read
        with pytest.raises(SystemExit) as end:
            evaluate()
        assert end.value.code == 4 and capfd.readouterr().err.strip().splitlines()[-1].startswith("error: ")
    assert not canary.exists()
