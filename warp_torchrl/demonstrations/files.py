"""Recordings in folders: memory-mapped tensors, as tensordict writes them, and a manifest with their checksums.

``steps`` holds what ``TensorDict.load_memmap`` reads. Here the manifest defines how each entry is read: nothing in a
folder is executed or unpickled, and no file outside of it is opened.
"""

import logging
import os
import re
from collections.abc import Mapping
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import tensordict
import torch
import torchrl
from tensordict import MemoryMappedTensor, TensorDict, TensorDictBase

from warp_torchrl.demonstrations.entries import Layout, entry_size, leaves
from warp_torchrl.demonstrations.events import Event
from warp_torchrl.demonstrations.recording import Recording
from warp_torchrl.models import OBSERVATION
from warp_torchrl.runs.config.compose import OPTION
from warp_torchrl.runs.config.saved_config import read_saved_config
from warp_torchrl.runs.output import draft_in, publish
from warp_torchrl.system import disk
from warp_torchrl.system.checksummed import (
    Files,
    Unsound,
    check_checksum,
    check_files,
    checked_files,
    checksummed,
    described,
    read_mapping,
)
from warp_torchrl.system.foreign import path_below
from warp_torchrl.system.foreign_text import plain_text

log = logging.getLogger("warp_torchrl")
RECORDING_FORMAT = 1
MANIFEST, _STEPS = "recording.json", "steps"
_ERRNO = re.compile(r"file <.*>: .*\((\d+)\)")
_FOLDER = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]*")
_MOST_STEPS, _MOST_AGENTS, _MOST_ACTIONS, _MOST_EVENTS = 1_000_000, 256, 1000, 10_000
_LARGEST, _LARGEST_META = 2**32, 100_000  # bytes
_LONGEST_NAME = 1000


def save_recording(recording: Recording, parent: Path) -> Path:
    """Write a recording into a new folder, which appears under its name when all of it is on the disk and was read.

    Args:
        recording: What was played.
        parent: Folder of recordings, made where it is not there; the new one is called scenario-seed-number, with the
            first number that is free, also among other processes.

    Raises:
        OSError: If a write fails, with the path; nothing is left.
        Unsound: If what was written is not what is read; nothing is left.
    """
    with draft_in(parent) as draft, disk.with_path(parent):
        _check_room(draft / ".room", recording.steps)
        _write(recording.steps, draft / _STEPS)
        (draft / MANIFEST).write_bytes(checksummed(_content(recording, draft)))
        read_recording(draft)
        return publish(draft, parent, (f"{recording.scenario}-{recording.seed}-{n}" for n in range(1, _MOST_STEPS)))


def read_recording(folder: Path) -> Recording:
    """Return the recording in a folder, every file of it verified first; its tensors stay on the disk.

    Raises:
        Unsound: If a file is missing, altered, or not of a known format.
    """
    path = folder / MANIFEST
    if path.is_symlink():
        raise Unsound(f"{path} is a link, and a recording's files must be there themselves")
    content = read_mapping(path)
    if content.get("format") != RECORDING_FORMAT:
        raise Unsound(f"{path} has format {content.get('format')!r:.80}, this version reads {RECORDING_FORMAT}")
    check_checksum(path, content)
    try:
        agents, actions = _names(content, "agents", _MOST_AGENTS), _names(content, "actions", _MOST_ACTIONS)
        steps = _whole(content["steps"], _MOST_STEPS)
        layout = Layout(steps=steps, agents=len(agents), actions=len(actions))
        entries = layout.check(content["entries"])
        files = checked_files(content["files"])
        _check_listed(files, entries)
        check_files(folder, files, _LARGEST)
        recording = Recording(
            steps=_mapped(folder, entries, layout),
            environment=read_saved_config(content["environment"]),
            seed=_whole(content["seed"], 2**62),
            events=_events(content["events"], steps),
            policy=_text(content["policy"]),
            frames=None if content["frames"] is None else _whole(content["frames"], 2**62),
            agents=agents,
            actions=actions,
            saved=_share(content.get("saved")),
        )
        if not OPTION.fullmatch(recording.environment.choices.get("scenario", "")):
            raise ValueError("it names no scenario")
        layout.check_numbers(recording.steps)
    except (TypeError, KeyError, ValueError, AttributeError, OverflowError, RuntimeError, OSError) as error:
        raise Unsound(
            f"{path} is not a recording of format {RECORDING_FORMAT}: {' '.join(str(error).split())}"
        ) from None
    return recording


def find_recordings(folder: Path) -> list[Path]:
    """Return the folders of all recordings in a folder, itself one or not, by name.

    Raises:
        Unsound: If there is none.
        OSError: If a folder cannot be read.
    """
    found, _ = search(folder)
    if not found:
        raise Unsound(f"{folder} holds no recording: no {MANIFEST} in it, nor in its folders")
    return found


def search(folder: Path) -> tuple[list[Path], list[Path]]:
    """Return the folders of recordings in a folder, by name, and the folders that are left out for their names.

    No link is followed. A folder whose name begins with a dot is a draft, or belongs to another program; one whose name
    has anything but ``A-Za-z0-9._-`` is left out, and a line of the log says so.

    Raises:
        OSError: If a folder cannot be read.
    """
    found, left_out = [], []
    for path, folders, files in os.walk(folder, onerror=_fail):
        for name in [each for each in folders if not _FOLDER.fullmatch(each)]:
            folders.remove(name)
            if not name.startswith("."):
                left_out.append(Path(path) / name)
                _say_left(left_out[-1])
        if MANIFEST in files:
            found.append(Path(path))
    return sorted(found), left_out


@cache
def _say_left(path: Path) -> None:
    """Say once that a folder is left."""
    log.warning(
        "%s is left: folders of recordings have names of A-Z, a-z, 0-9, '.', '_' and '-' alone", plain_text(str(path))
    )


def _fail(error: OSError) -> None:
    if not isinstance(error, (FileNotFoundError, NotADirectoryError)):  # it is none, or was removed meanwhile
        raise error


def _check_room(path: Path, steps: TensorDictBase) -> None:
    """Check that the disk has room for the steps: a full one would kill the process that writes into mapped memory."""
    if hasattr(os, "posix_fallocate"):
        with path.open("wb") as file:
            os.posix_fallocate(file.fileno(), 0, steps.bytes())
        path.unlink()


def _write(steps: TensorDictBase, folder: Path) -> None:
    """Write steps as memory-mapped tensors.

    Raises:
        OSError: If it fails.
    """
    try:
        steps.to_tensordict().memmap(folder, copy_existing=True)
    except RuntimeError as error:
        number = _ERRNO.search(str(error))  # torch tells it in its message alone
        if number is None:
            raise
        raise OSError(int(number[1]), os.strerror(int(number[1])), str(folder)) from None


def _content(recording: Recording, folder: Path) -> dict[str, Any]:
    libraries = {"torch": torch, "torchrl": torchrl, "tensordict": tensordict}
    entries = {
        name: {"dtype": str(value.dtype).removeprefix("torch."), "shape": list(value.shape)}
        for name, value in leaves(recording.steps)
    }
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    return {
        "format": RECORDING_FORMAT,
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


def _check_listed(files: Files, entries: Mapping[str, tuple[torch.dtype, tuple[int, ...]]]) -> None:
    """Check that a manifest lists the file of each entry, with its size, and what tensordict writes beside them alone.

    Raises:
        ValueError: If it lists less, or anything else.
    """
    needed = {f"{_STEPS}/{name}.memmap": entry_size(*entry) for name, entry in entries.items()}
    for name, wanted in needed.items():
        if name not in files:
            raise ValueError(f"{name} has no file of its own")
        if files[name]["size"] != wanted:
            raise ValueError(f"{name} does not fit its file, of {files[name]['size']} bytes and not {wanted}")
    for name in files.keys() - needed.keys():
        if not name.startswith(f"{_STEPS}/") or not name.endswith("/meta.json"):
            raise ValueError(f"file {name[:80]!r} is none of a recording")
        if files[name]["size"] > _LARGEST_META:
            raise ValueError(f"{name[:80]} must have at most {_LARGEST_META} bytes, got {files[name]['size']}")


def _mapped(folder: Path, entries: Mapping[str, tuple[torch.dtype, tuple[int, ...]]], layout: Layout) -> TensorDictBase:
    """Map the tensors of a folder, by the manifest's entries."""
    steps = TensorDict({}, batch_size=[layout.steps])
    for name, (dtype, shape) in entries.items():
        path = path_below(folder, f"{_STEPS}/{name}.memmap")
        steps[tuple(name.split("/"))] = MemoryMappedTensor.from_filename(path, dtype, torch.Size(shape))
    for key in (OBSERVATION, OBSERVATION[:1], ("next", *OBSERVATION[:1])):
        if isinstance(steps.get(key, None), TensorDictBase):
            steps[key].batch_size = torch.Size([layout.steps, layout.agents])
    return steps


def _events(content: Any, steps: int) -> tuple[Event, ...]:
    if not isinstance(content, list) or len(content) > _MOST_EVENTS:
        raise ValueError(f"events must be a list of at most {_MOST_EVENTS}")
    events = tuple(Event(**{**each, "numbers": tuple(each["numbers"])}) for each in content)
    if any(each.step > steps for each in events):
        raise ValueError(f"an event must come before one of {steps} steps, or after the last")
    return events


def _names(content: Mapping[str, Any], what: str, most: int) -> tuple[str, ...]:
    names = content[what]
    if not isinstance(names, list) or not 0 < len(names) <= most or len(set(map(str, names))) < len(names):
        raise ValueError(f"{what} must be 1 to {most} names, each once")
    return tuple(map(_text, names))


def _text(value: object) -> str:
    if not isinstance(value, str) or len(value) > _LONGEST_NAME:
        raise ValueError(f"a text of at most {_LONGEST_NAME} characters is expected, got {value!r:.80}")
    return value


def _whole(value: object, most: int) -> int:
    if type(value) is not int or not 0 <= value <= most:
        raise ValueError(f"a whole number up to {most} is expected, got {value!r:.80}")
    return value


def _share(value: object) -> float | None:
    if value is None or (isinstance(value, int | float) and not isinstance(value, bool) and 0.0 <= value <= 1.0):
        return value
    raise ValueError(f"a share in 0..1 is expected, got {value!r:.80}")
