"""What a checkpoint says of itself: ``manifest.json``, with the size and sha256 of every file, and its own."""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import tensordict
import torch
import torchrl

from warp_torchrl.models import Entry, Signature
from warp_torchrl.observation import DEFAULT, PICTURE, STATE_SYMMETRY, former_symmetry
from warp_torchrl.symmetry import Symmetry, from_plain, to_plain
from warp_torchrl.world.state import Action

FORMAT = 2
"""Version of the layout that is written."""
_READ = (1, FORMAT)  # 1 had no seal
MANIFEST = "manifest.json"
TRAINING = "training.pt"
_POLICY = ("policy.pt", "config.json")  # what acting takes
_FILES = ("policy.pt", TRAINING, "config.json")
_LARGEST_JSON = 1_000_000
_FORMER_NAMES = {"view": DEFAULT, "picture": PICTURE}
_FORMER_ACTIONS = tuple(action.name.lower() for action in Action)
"""Names of channels and actions in manifests that do not tell them."""


class CheckpointError(Exception):
    """No sound checkpoint, told in one line."""


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """What a checkpoint says of itself.

    Attributes:
        format: Version of the layout.
        frames: World steps trained.
        scenario: Name of the scenario.
        signature: Inputs and outputs of the policy.
        mode: How the policy acts best on training seeds, ``sampled`` or ``deterministic``; None before that is known.
        versions: Of the libraries that wrote it.
        files: Size and sha256 by file name.
    """

    format: int
    frames: int
    scenario: str
    signature: Signature
    mode: str | None
    versions: dict[str, str]
    files: dict[str, dict[str, Any]]

    def __post_init__(self) -> None:
        if type(self.frames) is not int or self.mode not in (None, "sampled", "deterministic"):
            raise ValueError(f"frames must be whole and mode one of ours, got {self.frames!r}, {self.mode!r}")


def read_manifest(folder: Path) -> Manifest:
    """Return what a checkpoint says of itself, once every file was found to be as it says.

    Raises:
        CheckpointError: If a file is missing, altered, or not ours.
    """
    manifest = _told(folder)
    for name, entry in manifest.files.items():
        path, size = folder / name, entry["size"]
        if not path.is_file() or path.stat().st_size != size:
            raise CheckpointError(f"{path} is missing or was cut: {size} bytes are expected")
        if _sha256(path) != entry["sha256"]:
            raise CheckpointError(f"{path} was altered: its sha256 is not the manifest's")
    return manifest


def _told(folder: Path) -> Manifest:
    path = folder / MANIFEST
    content = read_json(path)
    if content.get("format") not in _READ:
        raise CheckpointError(
            f"{folder} has format {content.get('format')!r}, this version reads {', '.join(map(str, _READ))}"
        )
    if content["format"] == FORMAT:
        content.pop("sha256", None)
        if path.read_bytes() != _sealed(content):
            raise CheckpointError(f"{path} was altered: its sha256 is not its own")
    try:
        signature = _signature_from_json(content.pop("signature"))
        manifest = Manifest(signature=signature, **content)
        files = {name: (entry["size"], entry["sha256"]) for name, entry in manifest.files.items()}
    except (TypeError, KeyError, ValueError, AttributeError, OverflowError):
        raise CheckpointError(f"{path} is not a manifest of format {content['format']}") from None
    if set(files) not in (set(_FILES), set(_POLICY)):
        raise CheckpointError(f"{path} must list {', '.join(_FILES)}; a policy alone lists no {TRAINING}")
    return manifest


def _sealed(content: Mapping[str, Any]) -> bytes:
    """Return the one text that a manifest with this content has: any other byte in the file is an alteration."""
    digest = hashlib.sha256(json.dumps(content).encode()).hexdigest()
    return json.dumps({**content, "sha256": digest}, indent=1).encode()


def read_json(path: Path) -> dict[str, Any]:
    """Return the mapping that a file of ours holds.

    Raises:
        CheckpointError: If it cannot be read or holds something else.
    """
    try:
        if path.stat().st_size > _LARGEST_JSON:
            raise CheckpointError(f"{path} is too large to be one of ours")
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise CheckpointError(f"{path} cannot be read: {first_line(error)}") from None
    if not isinstance(content, dict):
        raise CheckpointError(f"{path} must hold a mapping")
    return content


def write_manifest(folder: Path, frames: int, scenario: str, signature: Signature, mode: str | None) -> None:
    """Write what a folder that holds the other files says of itself; see ``Manifest``."""
    libraries = {"torch": torch, "torchrl": torchrl, "tensordict": tensordict}
    manifest = Manifest(
        format=FORMAT,
        frames=frames,
        scenario=scenario,
        signature=signature,
        mode=mode,
        versions={name: library.__version__ for name, library in libraries.items()},
        files={name: _describe(folder / name) for name in _FILES if (folder / name).exists()},
    )
    (folder / MANIFEST).write_bytes(_sealed(asdict(manifest) | {"signature": _signature_to_json(signature)}))


def _describe(path: Path) -> dict[str, Any]:
    return {"size": path.stat().st_size, "sha256": _sha256(path)}


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def first_line(error: Exception) -> str:
    """Return the first line of what an error says."""
    return (str(error).splitlines() or [type(error).__name__])[0]


def _signature_to_json(signature: Signature) -> dict[str, Any]:
    def entry(each: Entry) -> dict[str, Any]:
        return each._asdict() | {"symmetry": None if each.symmetry is None else to_plain(each.symmetry)}

    return signature._asdict() | {
        "observation": {name: entry(each) for name, each in signature.observation.items()},
        "state": entry(signature.state),
        "n_actions": signature.n_actions,
    }


def _signature_from_json(content: dict[str, Any]) -> Signature:
    def entry(node: dict[str, Any], names: tuple[str, ...], former: Callable[..., Symmetry | None]) -> Entry:
        shape = tuple(int(side) for side in node["shape"])
        told = tuple(str(name) for name in node.get("names", names if len(names) == shape[0] else ()))
        if told and len(told) != shape[0]:
            raise ValueError(f"{len(told)} names of {shape[0]} channels")
        plain = node.get("symmetry")
        symmetry = former(shape, told) if "symmetry" not in node else plain and from_plain(plain)
        if symmetry is not None and not symmetry.fits(shape):
            raise ValueError(f"{symmetry} is not of shape {shape}")
        return Entry(shape, str(node["dtype"]), told, symmetry)

    observation = {
        str(name): entry(node, _FORMER_NAMES.get(name, ()), partial(former_symmetry, name))
        for name, node in content["observation"].items()
    }
    state = entry(content["state"], (), lambda shape, _: STATE_SYMMETRY if STATE_SYMMETRY.fits(shape) else None)
    actions = tuple(str(name) for name in content.get("actions", _FORMER_ACTIONS[: int(content["n_actions"])]))
    return Signature(observation, state, int(content["n_agents"]), actions, int(content.get("n_roles", 2)))
