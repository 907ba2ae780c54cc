"""Checkpoints: written atomically, and verified before they are read.

``checkpoints/<frames>/`` holds ``policy.pt`` and ``training.pt`` (tensors and plain values, read with
``weights_only=True``), ``config.json``, and ``manifest.json``, see ``warp_torchrl.runs.manifest``.
"""

import errno
import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import torch

from warp_torchrl.models import Signature
from warp_torchrl.runs.config.saved_config import SavedConfig, read_saved_config
from warp_torchrl.runs.manifest import (
    MANIFEST,
    POLICY,
    TRAINING,
    CheckpointError,
    Manifest,
    manifest_bytes,
    of_a_checkpoint,
    read_manifest,
    write_manifest,
)
from warp_torchrl.runs.output import draft_in, publish
from warp_torchrl.system import disk
from warp_torchrl.system.checksummed import read_mapping
from warp_torchrl.system.foreign_text import plain_text
from warp_torchrl.system.tensors import check_finite, load_tensors

__all__ = [
    "MANIFEST",
    "Checkpoint",
    "CheckpointError",
    "export",
    "holds_any",
    "leave_policy",
    "newest",
    "save",
]
_LONGEST = 1000  # characters of a line that tells why a checkpoint is skipped


@dataclass(frozen=True, kw_only=True)
class Checkpoint:
    """A checkpoint with verified files.

    Attributes:
        path: The checkpoint's folder.
        manifest: Content of ``manifest.json``.
    """

    path: Path
    manifest: Manifest

    def saved_config(self) -> SavedConfig:
        """Return the training's configuration."""
        path = self.path / "config.json"
        with of_a_checkpoint():
            content = read_mapping(path)
        try:
            return read_saved_config(content)
        except ValueError as error:
            raise CheckpointError(f"{path} is not a run's configuration: {error}") from None

    def policy(self) -> dict[str, torch.Tensor]:
        """Return the policy's parameters, all of them finite."""
        parameters = self._load("policy.pt")
        for name, value in parameters.items():
            if not (isinstance(name, str) and isinstance(value, torch.Tensor)):
                raise CheckpointError(f"{self.path / 'policy.pt'} must hold tensors by their names")
        return parameters

    def training(self) -> dict[str, Any]:
        """Return the training state, for a resume; all its numbers are finite."""
        self.check_goes_on()
        return self._load(TRAINING)

    @property
    def goes_on(self) -> bool:
        """Return whether there is a training state: an exported policy has none, see ``export``."""
        return TRAINING in self.manifest.files

    def check_goes_on(self) -> None:
        """Check that the checkpoint has a training state.

        Raises:
            CheckpointError: If it is an exported policy.
        """
        if not self.goes_on:
            raise CheckpointError(f"{self.path} holds a policy alone: it acts, and nothing goes on from it")

    def _load(self, name: str) -> dict[str, Any]:
        path = self.path / name
        with of_a_checkpoint():
            content = load_tensors(path)
            check_finite(path, content)
        if not isinstance(content, dict):
            raise CheckpointError(f"{path} must hold a mapping")
        return content


def save(
    run: Path,
    *,
    frames: int,
    scenario: str,
    signature: Signature,
    mode: str | None,
    saved_config: SavedConfig,
    policy: Mapping[str, torch.Tensor],
    training: Mapping[str, Any],
    keep: int,
    stays: Callable[[int], bool] = lambda frames: True,
) -> Path:
    """Write a checkpoint, then delete old ones: the newest two stay, and the newest others that ``stays`` allows.

    The checkpoint appears under its name only when every file is on the disk: draft, fsync, rename, fsync. Drafts of
    killed saves are deleted first, newer unsound checkpoints after this one is safe.

    Args:
        run: The run folder.
        frames: World steps trained; names the folder.
        scenario: See ``Manifest``.
        signature: See ``Manifest``.
        mode: See ``Manifest``.
        saved_config: The configuration.
        policy: The policy's parameters.
        training: The training state.
        keep: Number of checkpoints to keep, at least two.
        stays: Called with a checkpoint's frames; returns whether it may stay when two are newer.

    Returns:
        The checkpoint's folder.

    Raises:
        OSError: If a write fails; the older checkpoints stay.
    """
    parent = run / "checkpoints"
    final = parent / f"{frames}"
    with draft_in(parent) as draft:
        if not _is_sound(final):
            with disk.with_path(draft):
                disk.save_tensors(draft / "policy.pt", dict(policy))
                disk.save_tensors(draft / TRAINING, dict(training))
                _write_saved_config(draft, saved_config)
                write_manifest(draft, frames, scenario, signature, mode)
            shutil.rmtree(final, ignore_errors=True)  # an unsound one
            publish(draft, parent, [final.name])
            disk.sync(run)  # where the folder of checkpoints may be new
    _drop(run, final, keep, stays)
    return final


def export(
    found: Checkpoint,
    folder: Path,
    saved_config: SavedConfig | None = None,
    policy: Mapping[str, torch.Tensor] | None = None,
    check: Callable[[Checkpoint], object] = lambda made: None,
) -> None:
    """Write a checkpoint without its training state into a new folder, which appears once its content was loaded.

    Its configuration does not name the run from which the training started: other machines do not have that path.

    Args:
        found: The checkpoint.
        folder: New folder.
        saved_config: Configuration; None takes the checkpoint's.
        policy: The policy's parameters; None takes the checkpoint's.
        check: Called with the new checkpoint before the folder has its name; an error leaves nothing.

    Raises:
        CheckpointError: If its files cannot be read, or the copy differs from the original.
        FileExistsError: If the folder exists.
        OSError: If a write fails.
    """
    if folder.exists():
        raise FileExistsError(errno.EEXIST, "it is there already", str(folder))
    saved_config = found.saved_config() if saved_config is None else saved_config
    saved_config = replace(saved_config, values={**saved_config.values, "start_from": None})
    parameters = found.policy() if policy is None else policy
    with draft_in(folder.parent) as draft, disk.with_path(folder):
        if policy is None:
            shutil.copyfile(found.path / "policy.pt", draft / "policy.pt")
        else:
            disk.save_tensors(draft / "policy.pt", dict(policy))
        _write_saved_config(draft, saved_config)
        of = found.manifest
        write_manifest(draft, of.frames, of.scenario, of.signature, of.mode)
        made = _verified(draft)
        if made.saved_config() != saved_config or not _is_equal(made.policy(), parameters):
            raise CheckpointError(f"{folder} cannot be written: what is read there is not what was written")
        check(made)
        publish(draft, folder.parent, [folder.name])


def _is_equal(one: Mapping[str, torch.Tensor], other: Mapping[str, torch.Tensor]) -> bool:
    return one.keys() == other.keys() and all(torch.equal(one[name], other[name].cpu()) for name in one)


def _write_saved_config(folder: Path, saved_config: SavedConfig) -> None:
    (folder / "config.json").write_text(json.dumps(asdict(saved_config), indent=1), encoding="utf-8")


def leave_policy(run: Path) -> None:
    """Delete a run's checkpoints except the policy of the newest, from which no training can resume.

    Raises:
        CheckpointError: If no checkpoint is sound.
        OSError: If a write fails; all checkpoints stay.
    """
    found, _ = newest(run)
    of = found.manifest
    described = manifest_bytes(found.path, of.frames, of.scenario, of.signature, of.mode, POLICY)
    disk.replace(found.path / MANIFEST, described)  # from now on it has no training state
    (found.path / TRAINING).unlink(missing_ok=True)
    for folder in (each for each in _listed(run) if each != found.path):
        shutil.rmtree(folder, ignore_errors=True)


def holds_any(run: Path) -> bool:
    """Return whether a run folder holds checkpoints, sound or not."""
    return bool(_listed(run))


def newest(path: Path | str) -> tuple[Checkpoint, list[str]]:
    """Find the newest sound checkpoint.

    Args:
        path: A run folder, or one checkpoint folder.

    Returns:
        The checkpoint, and for each newer unsound one a line with the reason.

    Raises:
        CheckpointError: If no checkpoint is sound.
    """
    path = Path(path)
    if (path / MANIFEST).exists() or path.parent.name == "checkpoints":
        return _verified(path), []
    if not path.is_dir():
        raise CheckpointError(f"{path} is not a run folder: nothing there")
    skipped: list[str] = []
    for folder in _listed(path):
        try:
            return _verified(folder, frames=int(folder.name)), skipped
        except CheckpointError as error:
            skipped.append(plain_text(str(error), _LONGEST))
    reason = f": {skipped[0]}" if skipped else f": no folder in {path / 'checkpoints'}"
    raise CheckpointError(f"{path} holds no sound checkpoint{reason}")


def _drop(run: Path, newest: Path, keep: int, stays: Callable[[int], bool]) -> None:
    """Delete old checkpoints, and those newer than this one: they are unsound, or the run would have resumed there."""
    listed = _listed(run)
    place = listed.index(newest)
    older = [folder for folder in listed[place + 2 :] if stays(int(folder.name))]
    kept = {*listed[place : place + 2], *older[: keep - 2]}
    for folder in listed:
        if folder not in kept:
            shutil.rmtree(folder, ignore_errors=True)


def _listed(run: Path) -> list[Path]:
    """Return the checkpoint folders, newest first."""
    parent = run / "checkpoints"
    folders = [each for each in parent.iterdir() if each.name.isdigit()] if parent.is_dir() else []
    return sorted(folders, key=lambda each: int(each.name), reverse=True)


def _verified(folder: Path, frames: int | None = None) -> Checkpoint:
    """Check every file of a checkpoint against its manifest before any of them is parsed."""
    manifest = read_manifest(folder)
    if frames not in (None, manifest.frames):
        raise CheckpointError(f"{folder} holds a checkpoint of {manifest.frames} frames")
    return Checkpoint(path=folder, manifest=manifest)


def _is_sound(folder: Path) -> bool:
    try:
        _verified(folder)
    except CheckpointError:
        return False
    return True
