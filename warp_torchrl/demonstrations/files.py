"""Recordings in folders: memory-mapped tensors, as tensordict writes them, and a manifest that vouches for them.

``steps`` holds what ``TensorDict.load_memmap`` reads. Here it is read by what the manifest says of each entry: nothing
in a folder is executed or unpickled.
"""

import os
import re
import shutil
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import tensordict
import torch
import torchrl
from tensordict import MemoryMappedTensor, TensorDict, TensorDictBase

from warp_torchrl.config.renamed import renamed_values
from warp_torchrl.config.saved_config import SavedConfig
from warp_torchrl.demonstrations.events import Event
from warp_torchrl.demonstrations.recording import MOVER, PROPOSED, Mover, Recording
from warp_torchrl.models import ACTION, ACTION_MASK, OBSERVATION
from warp_torchrl.observation import renamed
from warp_torchrl.runs import disk
from warp_torchrl.runs.sealed import Unsound, check_files, check_seal, described, read_json, sealed

FORMAT = 1
MANIFEST, _STEPS = "recording.json", "steps"
_PART = re.compile(r"[a-z0-9_]+")
_DTYPES = {str(each).removeprefix("torch."): each for each in (torch.bool, torch.uint8, torch.int64, torch.float32)}
_MOST_STEPS, _MOST_AGENTS = 1_000_000, 10_000


def save(recording: Recording, parent: Path) -> Path:
    """Write a recording into a new folder, which appears under its name when all of it is on the disk.

    Args:
        recording: What was played.
        parent: Folder of recordings, made where it is not there; the new one is called scenario-seed-number.

    Raises:
        OSError: If a write fails, with the path; nothing is left.
    """
    stem = f"{recording.scenario}-{recording.seed}"
    with disk.with_path(parent):
        parent.mkdir(parents=True, exist_ok=True)
        folder = next(each for number in range(1, _MOST_STEPS) if not (each := parent / f"{stem}-{number}").exists())
        draft = parent / f".{folder.name}.tmp"
        shutil.rmtree(draft, ignore_errors=True)
        try:
            draft.mkdir()
            _check_room(draft / ".room", recording.steps)
            recording.steps.to_tensordict().memmap(draft / _STEPS, copy_existing=True)
            (draft / MANIFEST).write_bytes(sealed(_content(recording, draft)))
            for path in (*draft.rglob("*"), draft):
                disk.sync(path)
            draft.rename(folder)
            disk.sync(parent)
        finally:
            shutil.rmtree(draft, ignore_errors=True)
    return folder


def read(folder: Path) -> Recording:
    """Return the recording in a folder, every file of it verified first; its tensors stay on the disk.

    Raises:
        Unsound: If a file is missing, altered, or not of a known format.
    """
    path = folder / MANIFEST
    content = read_json(path)
    if content.get("format") != FORMAT:
        raise Unsound(f"{path} has format {content.get('format')!r}, this version reads {FORMAT}")
    check_seal(path, content)
    try:
        files = content["files"]
        check_files(folder, files)
        count, agents = _whole(content["steps"], _MOST_STEPS), tuple(map(str, content["agents"]))
        steps = _steps(folder / _STEPS, content["entries"], count, len(agents), set(files))
        recording = Recording(
            steps=steps,
            environment=SavedConfig(
                choices=content["environment"]["choices"], values=renamed_values(content["environment"]["values"])
            ),
            seed=_whole(content["seed"], 2**62),
            events=tuple(Event(**{**each, "numbers": tuple(each["numbers"])}) for each in content["events"]),
            policy=str(content["policy"]),
            frames=None if content["frames"] is None else _whole(content["frames"], 2**62),
            agents=agents,
            actions=tuple(map(str, content["actions"])),
            saved=_share(content.get("saved")),
        )
        _check(recording)
    except (TypeError, KeyError, ValueError, AttributeError, OverflowError, RuntimeError, OSError) as error:
        raise Unsound(f"{path} is not a recording of format {FORMAT}: {' '.join(str(error).split())}") from None
    return recording


def find(folder: Path) -> list[Path]:
    """Return the folders of all recordings in a folder, itself one or not, by name.

    Raises:
        Unsound: If there is none.
    """
    found = sorted(path.parent for path in folder.rglob(MANIFEST) if not path.parent.name.startswith("."))
    if not found:
        raise Unsound(f"{folder} holds no recording: no {MANIFEST} in it, nor in its folders")
    return found


def _check_room(path: Path, steps: TensorDictBase) -> None:
    """Check that the disk has room for the steps: a full one would kill the process that writes into mapped memory."""
    if hasattr(os, "posix_fallocate"):
        with path.open("wb") as file:
            os.posix_fallocate(file.fileno(), 0, steps.bytes())
        path.unlink()


def _content(recording: Recording, folder: Path) -> dict[str, Any]:
    libraries = {"torch": torch, "torchrl": torchrl, "tensordict": tensordict}
    entries = {
        "/".join(key): {"dtype": str(value.dtype).removeprefix("torch."), "shape": list(value.shape)}
        for key, value in _leaves(recording.steps)
    }
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    return {
        "format": FORMAT,
        "steps": recording.steps.batch_size[0],
        "entries": entries,
        "environment": asdict(recording.environment),
        "seed": recording.seed,
        "events": [asdict(each) for each in recording.events],
        "policy": recording.policy,
        "frames": recording.frames,
        "agents": list(recording.agents),
        "actions": list(recording.actions),
        "saved": recording.saved,
        "versions": {name: library.__version__ for name, library in libraries.items()},
        "files": described(folder, names),
    }


def _leaves(steps: TensorDictBase) -> Iterator[tuple[tuple[str, ...], torch.Tensor]]:
    for key, value in steps.items(include_nested=True, leaves_only=True):
        yield (key if isinstance(key, tuple) else (key,)), value


def _steps(folder: Path, entries: dict[str, Any], count: int, agents: int, listed: set[str]) -> TensorDictBase:
    """Map the tensors of a folder by what the manifest says of each."""
    steps = TensorDict({}, batch_size=[count])
    for name, entry in entries.items():
        parts = tuple(name.split("/"))
        path = folder.joinpath(*parts).with_suffix(".memmap")
        if not all(_PART.fullmatch(part) for part in parts) or f"{_STEPS}/{name}.memmap" not in listed:
            raise ValueError(f"entry {name} has no file of its own")
        shape, dtype = tuple(_whole(side, _MOST_STEPS) for side in entry["shape"]), _DTYPES[entry["dtype"]]
        if shape[:1] != (count,) or path.stat().st_size != torch.Size(shape).numel() * dtype.itemsize:
            raise ValueError(f"entry {name} of shape {list(shape)} does not fit its file")
        steps[tuple(map(renamed, parts))] = MemoryMappedTensor.from_filename(path, dtype, torch.Size(shape))
    for key in (OBSERVATION, OBSERVATION[:1], ("next", *OBSERVATION[:1])):
        if isinstance(steps.get(key, None), TensorDictBase):
            steps[key].batch_size = torch.Size([count, agents])
    return steps


def _check(recording: Recording) -> None:
    """Check that a recording's parts fit each other."""
    count, agents, actions = len(recording.steps), len(recording.agents), len(recording.actions)
    if not 0 < agents <= _MOST_AGENTS or "scenario" not in recording.environment.choices:
        raise ValueError("it names no agents or no scenario")
    for key in (ACTION, PROPOSED, MOVER):
        if recording.steps[key].shape != (count, agents):
            raise ValueError(f"{key[-1]} must be of {count} steps and {agents} agents")
    if recording.steps[ACTION_MASK].shape != (count, agents, actions):
        raise ValueError(f"the mask must be of {actions} actions")
    for key in (ACTION, PROPOSED):
        if not bool(((recording.steps[key] >= 0) & (recording.steps[key] < actions)).all()):
            raise ValueError(f"{key[-1]} must be one of {actions} actions everywhere")
    if int(recording.steps[MOVER].max()) > max(Mover) or any(each.step > count for each in recording.events):
        raise ValueError("a mover or the step of an event is unknown")


def _whole(value: object, most: int) -> int:
    if type(value) is not int or not 0 <= value <= most:
        raise ValueError(f"a whole number up to {most} is expected, got {value!r}")
    return value


def _share(value: object) -> float | None:
    if value is None or (isinstance(value, float | int) and 0.0 <= value <= 1.0):
        return value
    raise ValueError(f"a share in 0..1 is expected, got {value!r}")
