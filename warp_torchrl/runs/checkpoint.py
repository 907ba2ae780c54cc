"""Checkpoints: written atomically, and verified before they are read.

``checkpoints/<frames>/`` holds ``policy.pt`` and ``training.pt`` (tensors and plain values, read with
``weights_only=True``), ``config.json``, and ``manifest.json``, see ``warp_torchrl.runs.manifest``.
"""

import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path, PurePath
from typing import Any

import torch

from warp_torchrl.models import Signature
from warp_torchrl.runs.config.saved_config import SavedConfig, read_saved_config
from warp_torchrl.runs.history import History, Teacher, stage_of, teacher_names, with_steps
from warp_torchrl.runs.manifest import (
    MANIFEST,
    POLICY,
    TRAINING,
    WEIGHTS,
    CheckpointError,
    Manifest,
    manifest_bytes,
    of_a_checkpoint,
    read_manifest,
    write_manifest,
)
from warp_torchrl.runs.output import draft_in, publish
from warp_torchrl.runs.safe_weights import SAFE_WEIGHTS, read_safe_weights
from warp_torchrl.system import disk
from warp_torchrl.system.checksummed import read_mapping
from warp_torchrl.system.foreign_text import plain_text
from warp_torchrl.system.tensors import check_finite, load_tensors

__all__ = [
    "MANIFEST",
    "Checkpoint",
    "CheckpointError",
    "holds_any",
    "leave_policy",
    "newest",
    "save",
    "verified",
    "write_saved_config",
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
        parameters = self._load(self.weights)
        for name, value in parameters.items():
            if not (isinstance(name, str) and isinstance(value, torch.Tensor)):
                raise CheckpointError(f"{self.path / self.weights} must hold tensors by their names")
        return parameters

    @property
    def weights(self) -> str:
        """Return the name of the file with the policy's parameters."""
        return SAFE_WEIGHTS if SAFE_WEIGHTS in self.manifest.files else WEIGHTS

    @property
    def history(self) -> History:
        """Return the trainings behind the policy; without a record the last one, by its configuration."""
        if self.manifest.history:
            return self.manifest.history
        saved, of = self.saved_config(), self.manifest
        teachers = [Teacher(name=plain_text(PurePath(name).name)) for name in teacher_names(saved.values)]
        return (with_steps(stage_of(saved.choices, saved.values, of.scenario, (), teachers), of.frames),)

    def training(self) -> dict[str, Any]:
        """Return the training state, for a resume; all its numbers are finite."""
        self.check_goes_on()
        return self._load(TRAINING)

    @property
    def goes_on(self) -> bool:
        """Return whether there is a training state: an exported policy has none, see ``warp_torchrl.runs.export``."""
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
            content = read_safe_weights(path) if name == SAFE_WEIGHTS else load_tensors(path)
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
    history: History = (),
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
        history: See ``Manifest``.

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
                disk.save_tensors(draft / WEIGHTS, dict(policy))
                disk.save_tensors(draft / TRAINING, dict(training))
                write_saved_config(draft, saved_config)
                write_manifest(
                    draft, Manifest(frames=frames, scenario=scenario, signature=signature, mode=mode, history=history)
                )
            shutil.rmtree(final, ignore_errors=True)  # an unsound one
            publish(draft, parent, [final.name])
            disk.sync(run)  # where the folder of checkpoints may be new
    _drop(run, final, keep, stays)
    return final


def write_saved_config(folder: Path, saved_config: SavedConfig) -> None:
    """Write the configuration of a checkpoint into its folder."""
    (folder / "config.json").write_text(json.dumps(asdict(saved_config), indent=1), encoding="utf-8")


def leave_policy(run: Path) -> None:
    """Delete a run's checkpoints except the policy of the newest, from which no training can resume.

    Raises:
        CheckpointError: If no checkpoint is sound.
        OSError: If a write fails; all checkpoints stay.
    """
    found, _ = newest(run)
    described = manifest_bytes(found.path, found.manifest, POLICY)
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
        return verified(path), []
    if not path.is_dir():
        raise CheckpointError(f"{path} is not a run folder: nothing there")
    skipped: list[str] = []
    for folder in _listed(path):
        try:
            return verified(folder, frames=int(folder.name)), skipped
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


def verified(folder: Path, frames: int | None = None) -> Checkpoint:
    """Check every file of a checkpoint against its manifest before any of them is parsed."""
    manifest = read_manifest(folder)
    if frames not in (None, manifest.frames):
        raise CheckpointError(f"{folder} holds a checkpoint of {manifest.frames} frames")
    return Checkpoint(path=folder, manifest=manifest)


def _is_sound(folder: Path) -> bool:
    try:
        verified(folder)
    except CheckpointError:
        return False
    return True
