"""``manifest.json`` of a checkpoint, with the size and sha256 of every file and a sha256 of its own content."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import tensordict
import torch
import torchrl

from warp_torchrl.entries import Symmetry, Vector, from_plain, to_plain
from warp_torchrl.env.observation import DEFAULT, former_symmetry, renamed
from warp_torchrl.env.observation.former import FORMER_STATE, FORMER_STATUS, FORMER_STATUS_AND_IDENTITY
from warp_torchrl.models import Entry, Signature
from warp_torchrl.runs.config.compose import OPTION
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
from warp_torchrl.world.state.role import PAPER_ROLES
from warp_torchrl.world.state.state import Action

FORMAT = 2
"""Version of the format that checkpoints are written in."""
_READ = (1, FORMAT)  # 1 has no sha256 of its own
MANIFEST = "manifest.json"
TRAINING = "training.pt"
POLICY = ("policy.pt", "config.json")
"""Files of an exported policy."""
_FILES = ("policy.pt", TRAINING, "config.json")
_FORMER_NAMES = {
    "view": (DEFAULT,),
    "picture": (("fire", "fuel", "team_mates"),),
    "status": tuple(Vector(parts).names for parts in (FORMER_STATUS, FORMER_STATUS_AND_IDENTITY)),
    "state": (FORMER_STATE.names,),
}
_FORMER_ACTIONS = tuple(action.name.lower() for action in Action)
"""Channels and actions of manifests without names; one entry had two lengths."""


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
    files: Files

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
    if content.get("format") not in _READ:
        raise CheckpointError(
            f"{folder} has format {content.get('format')!r}, this version reads {', '.join(map(str, _READ))}"
        )
    if content["format"] == FORMAT:
        check_checksum(path, content)
    try:
        signature = _signature_from_json(content.pop("signature"))
        manifest = Manifest(signature=signature, **content)
        files = checked_files(manifest.files)
    except (TypeError, KeyError, ValueError, AttributeError, OverflowError):
        raise CheckpointError(f"{path} is not a manifest of format {content['format']}") from None
    if set(files) not in (set(_FILES), set(POLICY)):
        raise CheckpointError(f"{path} must list {', '.join(_FILES)}; a policy alone lists no {TRAINING}")
    return manifest


def write_manifest(folder: Path, frames: int, scenario: str, signature: Signature, mode: str | None) -> None:
    """Write the manifest of a folder that holds the other files; see ``Manifest``."""
    names = [name for name in _FILES if (folder / name).exists()]
    (folder / MANIFEST).write_bytes(manifest_bytes(folder, frames, scenario, signature, mode, names))


def manifest_bytes(
    folder: Path, frames: int, scenario: str, signature: Signature, mode: str | None, names: Iterable[str]
) -> bytes:
    """Return the manifest of a folder that holds the named files; see ``Manifest``."""
    libraries = {"torch": torch, "torchrl": torchrl, "tensordict": tensordict}
    manifest = Manifest(
        format=FORMAT,
        frames=frames,
        scenario=scenario,
        signature=signature,
        mode=mode,
        versions={name: library.__version__ for name, library in libraries.items()},
        files=described(folder, names),
    )
    return checksummed(asdict(manifest) | {"signature": _signature_to_json(signature)})


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

    observed = {renamed(str(name)): node for name, node in content["observation"].items()}
    observation = {name: entry(name, node, partial(former_symmetry, name)) for name, node in observed.items()}
    state = entry(
        "state", content["state"], lambda shape, _: FORMER_STATE.symmetry if FORMER_STATE.symmetry.fits(shape) else None
    )
    actions = tuple(str(name) for name in content.get("actions", _FORMER_ACTIONS[: int(content["n_actions"])]))
    roles = tuple(str(name) for name in content.get("roles", PAPER_ROLES))
    agencies = tuple(str(name) for name in content.get("agencies", ()))
    is_late = content.get("is_late", False) is True
    return Signature(observation, state, int(content["n_agents"]), actions, roles, agencies, is_late)
