"""Exports of policies: checkpoints without a training state, as pickled tensors or as safetensors."""

import errno
import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import torch

from warp_torchrl.runs.checkpoint import Checkpoint, CheckpointError, verified, write_saved_config
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.runs.manifest import WEIGHTS, write_manifest
from warp_torchrl.runs.output import draft_in, publish
from warp_torchrl.runs.safe_weights import SAFE_WEIGHTS, write_safe_weights
from warp_torchrl.system import disk


def export(
    found: Checkpoint,
    folder: Path,
    saved_config: SavedConfig | None = None,
    policy: Mapping[str, torch.Tensor] | None = None,
    check: Callable[[Checkpoint], object] = lambda made: None,
    write: Callable[[Path, Checkpoint], object] = lambda draft, made: None,
    is_safe: bool = False,
) -> None:
    """Write a checkpoint without its training state into a new folder, which appears once its content was loaded.

    Its configuration does not name the run from which the training started: other machines do not have that path.

    Args:
        found: The checkpoint.
        folder: New folder.
        saved_config: Configuration; None takes the checkpoint's.
        policy: The policy's parameters; None takes the checkpoint's.
        check: Called with the new checkpoint before the folder has its name; an error leaves nothing.
        write: Called with the draft and the new checkpoint to write further files.
        is_safe: Whether the parameters are written as safetensors.

    Raises:
        CheckpointError: If its files cannot be read, or the copy differs from the original.
        ConfigError: If ``is_safe`` and safetensors is not installed.
        FileExistsError: If the folder exists.
        OSError: If a write fails.
    """
    if folder.exists():
        raise FileExistsError(errno.EEXIST, "it is there already", str(folder))
    saved_config = found.saved_config() if saved_config is None else saved_config
    saved_config = replace(saved_config, values={**saved_config.values, "start_from": None})
    parameters = found.policy() if policy is None else policy
    with draft_in(folder.parent) as draft, disk.with_path(folder):
        if is_safe:
            write_safe_weights(draft / SAFE_WEIGHTS, parameters)
        elif policy is None and found.weights == WEIGHTS:
            shutil.copyfile(found.path / WEIGHTS, draft / WEIGHTS)
        else:
            disk.save_tensors(draft / WEIGHTS, dict(parameters))
        write_saved_config(draft, saved_config)
        write_manifest(draft, replace(found.manifest, history=found.history))
        made = verified(draft)
        if made.saved_config() != saved_config or not _is_equal(made.policy(), parameters):
            raise CheckpointError(f"{folder} cannot be written: what is read there is not what was written")
        check(made)
        write(draft, made)
        publish(draft, folder.parent, [folder.name])


def _is_equal(one: Mapping[str, torch.Tensor], other: Mapping[str, torch.Tensor]) -> bool:
    return one.keys() == other.keys() and all(torch.equal(one[name], other[name].cpu()) for name in one)
