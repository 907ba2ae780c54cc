"""``manifest.json`` of a checkpoint, with the size and sha256 of every file and a sha256 of its own content."""

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
from warp_torchrl.observation import DEFAULT, PICTURE, STATE, STATE_SYMMETRY, former_symmetry
from warp_torchrl.observation.own import IDENTITY, SELF
from warp_torchrl.symmetry import Symmetry, from_plain, to_plain
from warp_torchrl.world.role import PAPER_ROLES
from warp_torchrl.world.state import Action

FORMAT = 2
"""Version of the format that checkpoints are written in."""
_READ = (1, FORMAT)  # 1 has no sha256 of its own
MANIFEST = "manifest.json"
TRAINING = "training.pt"
_POLICY = ("policy.pt", "config.json")  # of an exported policy
_FILES = ("policy.pt", TRAINING, "config.json")
_LARGEST_JSON = 1_000_000
_FORMER_NAMES = {
    "view": (DEFAULT,),
    "picture": (PICTURE,),
    "self": (SELF.names, (*SELF.names, *IDENTITY.names)),
    "state": (STATE,),
}
_FORMER_ACTIONS = tuple(action.name.lower() for action in Action)
"""Channels and actions of manifests without names; one entry had two lengths."""


class CheckpointError(Exception):
    """There is no sound checkpoint; the message is one line."""


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """Content of ``manifest.json``.

    Attributes:
        format: Version of the format.
        frames: World steps trained.
        scenario: Name of the scenario.
        signature: Inputs and outputs of the policy.
        mode: The better mode on training seeds, ``sampled`` or ``deterministic``; None before it is known.
        versions: Versions of the libraries that wrote the checkpoint.
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
    """Read a checkpoint's manifest, and verify every file against it.

    Raises:
        CheckpointError: If a file is missing, altered, or not of a known format.
    """
    manifest = _parse_manifest(folder)
    for name, entry in manifest.files.items():
        path, size = folder / name, entry["size"]
        if not path.is_file() or path.stat().st_size != size:
            raise CheckpointError(f"{path} is missing or was cut: {size} bytes are expected")
        if _sha256(path) != entry["sha256"]:
            raise CheckpointError(f"{path} was altered: its sha256 is not the manifest's")
    return manifest


def _parse_manifest(folder: Path) -> Manifest:
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
    """Return the exact bytes of a manifest with this content and its sha256."""
    digest = hashlib.sha256(json.dumps(content).encode()).hexdigest()
    return json.dumps({**content, "sha256": digest}, indent=1).encode()


def read_json(path: Path) -> dict[str, Any]:
    """Return the mapping in a JSON file.

    Raises:
        CheckpointError: If the file cannot be read or holds no mapping.
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
    """Write the manifest of a folder that holds the other files; see ``Manifest``."""
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
    """Return the first line of an error's message."""
    return (str(error).splitlines() or [type(error).__name__])[0]


def _signature_to_json(signature: Signature) -> dict[str, Any]:
    def entry(each: Entry) -> dict[str, Any]:
        fields = each._asdict() | {"symmetry": None if each.symmetry is None else to_plain(each.symmetry)}
        return {name: value for name, value in fields.items() if name != "content"}  # of the world, not of the policy

    return signature._asdict() | {
        "observation": {name: entry(each) for name, each in signature.observation.items()},
        "state": entry(signature.state),
        "n_actions": signature.n_actions,
        "n_roles": signature.n_roles,
    }


def _signature_from_json(content: dict[str, Any]) -> Signature:
    former_names = _FORMER_NAMES if "roles" not in content else {}

    def entry(name: str, node: dict[str, Any], former: Callable[..., Symmetry | None]) -> Entry:
        shape = tuple(int(side) for side in node["shape"])
        names = next((names for names in former_names.get(name, ()) if len(names) == shape[0]), ())
        told = tuple(str(each) for each in node.get("names") or names)
        if told and len(told) != shape[0]:
            raise ValueError(f"{len(told)} names of {shape[0]} channels")
        plain = node.get("symmetry")
        symmetry = former(shape, told) if "symmetry" not in node else plain and from_plain(plain)
        if symmetry is not None and not symmetry.fits(shape):
            raise ValueError(f"{symmetry} is not of shape {shape}")
        return Entry(shape, str(node["dtype"]), told, symmetry)

    observation = {
        str(name): entry(name, node, partial(former_symmetry, name)) for name, node in content["observation"].items()
    }
    state = entry("state", content["state"], lambda shape, _: STATE_SYMMETRY if STATE_SYMMETRY.fits(shape) else None)
    actions = tuple(str(name) for name in content.get("actions", _FORMER_ACTIONS[: int(content["n_actions"])]))
    roles = tuple(str(name) for name in content.get("roles", PAPER_ROLES))
    return Signature(observation, state, int(content["n_agents"]), actions, roles)
