"""``manifest.json`` of a checkpoint, with the size and sha256 of every file and a sha256 of its own content."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import tensordict
import torch
import torchrl

from warp_torchrl.entries import from_plain, to_plain
from warp_torchrl.models import Entry, Signature
from warp_torchrl.runs.config.compose import OPTION
from warp_torchrl.runs.history import History, history_from_plain, history_to_plain
from warp_torchrl.runs.measured import Measured, measured_from_plain, measured_to_plain
from warp_torchrl.runs.safe_weights import SAFE_WEIGHTS
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
from warp_torchrl.system.tensors import largest

FORMAT = 2
"""Version of the format that checkpoints are written in."""
MANIFEST = "manifest.json"
TRAINING = "training.pt"
WEIGHTS = "policy.pt"
POLICY = (WEIGHTS, "config.json")
"""Files of an exported policy."""
SAFE_POLICY = (SAFE_WEIGHTS, "config.json")
"""Files of a policy that is exported as safetensors."""
_FILES = (WEIGHTS, TRAINING, "config.json")


class CheckpointError(Unsound):
    """There is no sound checkpoint; the message is one line."""


@contextmanager
def of_a_checkpoint() -> Iterator[None]:
    """Raise what is unsound as a ``CheckpointError``."""
    try:
        yield
    except Unsound as error:
        raise CheckpointError(str(error)) from None


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """Content of ``manifest.json``.

    Attributes:
        format: Version of the format.
        frames: World steps of this training alone; ``history`` has those before it.
        scenario: Name of the scenario.
        signature: Inputs and outputs of the policy.
        mode: The better mode on training seeds, ``sampled`` or ``deterministic``; None before it is known.
        versions: Versions of the libraries that wrote the checkpoint.
        files: Size and sha256 by file name.
        history: The trainings behind the policy, this one last; empty where the writer kept none.
        measured: Results of evaluations of this very policy.
    """

    format: int = FORMAT
    frames: int
    scenario: str
    signature: Signature
    mode: str | None
    versions: dict[str, str] = field(default_factory=dict)
    files: Files = field(default_factory=dict)
    history: History = ()
    measured: tuple[Measured, ...] = ()

    def __post_init__(self) -> None:
        if type(self.frames) is not int or self.mode not in (None, "sampled", "deterministic"):
            raise ValueError(f"frames must be whole and mode one of ours, got {self.frames!r}, {self.mode!r}")
        if not isinstance(self.scenario, str) or not OPTION.fullmatch(self.scenario):
            raise ValueError(f"scenario must be a name of letters, digits and _, got {self.scenario!r:.80}")


def read_manifest(folder: Path) -> Manifest:
    """Read a checkpoint's manifest, and verify every file against it.

    Raises:
        CheckpointError: If a file is missing, altered, or not of a known format.
    """
    with of_a_checkpoint():
        manifest = _parse_manifest(folder)
        check_files(folder, manifest.files, largest())
    return manifest


def _parse_manifest(folder: Path) -> Manifest:
    path = folder / MANIFEST
    content = read_mapping(path)
    if content.get("format") != FORMAT:
        raise CheckpointError(f"{folder} has format {content.get('format')!r}, this version reads {FORMAT}")
    check_checksum(path, content)
    try:
        signature = _signature_from_json(content.pop("signature"))
        history = history_from_plain(content.pop("history", []))
        measured = measured_from_plain(content.pop("measured", []))
        manifest = Manifest(signature=signature, history=history, measured=measured, **content)
        files = checked_files(manifest.files)
    except (TypeError, KeyError, ValueError, AttributeError, OverflowError):
        raise CheckpointError(f"{path} is not a manifest of format {content['format']}") from None
    if set(files) not in (set(_FILES), set(POLICY), set(SAFE_POLICY)):
        raise CheckpointError(f"{path} must list {', '.join(_FILES)}; a policy alone lists no {TRAINING}")
    return manifest


def write_manifest(folder: Path, of: Manifest) -> None:
    """Write the manifest of a folder that holds the other files; see ``manifest_bytes``."""
    names = [name for name in (SAFE_WEIGHTS, *_FILES) if (folder / name).exists()]
    (folder / MANIFEST).write_bytes(manifest_bytes(folder, of, names))


def manifest_bytes(folder: Path, of: Manifest, names: Iterable[str]) -> bytes:
    """Return the manifest of a folder that holds the named files.

    Args:
        folder: The folder.
        of: What it says beside the versions and the files, which are those of now.
        names: The files.
    """
    manifest = replace(of, format=FORMAT, versions=_versions(), files=described(folder, names))
    return checksummed(
        asdict(manifest)
        | {
            "signature": _signature_to_json(manifest.signature),
            "history": history_to_plain(manifest.history),
            "measured": measured_to_plain(manifest.measured),
        }
    )


def _versions() -> dict[str, str]:
    libraries = {"torch": torch, "torchrl": torchrl, "tensordict": tensordict}
    return {name: library.__version__ for name, library in libraries.items()}


def _signature_to_json(signature: Signature) -> dict[str, Any]:
    def entry(each: Entry) -> dict[str, Any]:
        fields = each._asdict() | {"symmetry": None if each.symmetry is None else to_plain(each.symmetry)}
        return {name: value for name, value in fields.items() if name != "content"}  # of the world, not of the policy

    return signature._asdict() | {
        "observation": {name: entry(each) for name, each in signature.observation.items()},
        "state": entry(signature.state),
    }


def _signature_from_json(content: dict[str, Any]) -> Signature:
    def entry(node: dict[str, Any]) -> Entry:
        shape = tuple(int(side) for side in node["shape"])
        names = tuple(str(each) for each in node["names"])
        if names and len(names) != shape[0]:
            raise ValueError(f"{len(names)} names of {shape[0]} channels")
        symmetry = node["symmetry"] and from_plain(node["symmetry"])
        if symmetry is not None and not symmetry.fits(shape):
            raise ValueError(f"{symmetry} is not of shape {shape}")
        return Entry(shape, str(node["dtype"]), names, symmetry)

    observation = {str(name): entry(node) for name, node in content["observation"].items()}
    actions, roles, agencies = (tuple(map(str, content[key])) for key in ("actions", "roles", "agencies"))
    state, n_agents, is_late = entry(content["state"]), int(content["n_agents"]), content["is_late"] is True
    return Signature(observation, state, n_agents, actions, roles, agencies, is_late)
