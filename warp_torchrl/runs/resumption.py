"""Resumption of a run with its checkpoint's configuration, in which only ``total_frames`` may change."""

import reprlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from warp_torchrl.runs.checkpoint import Checkpoint, newest
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.construction import COMPONENTS, ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.config.saved_config import SavedConfig, restore
from warp_torchrl.runs.destination import LARGEST_EVALUATION
from warp_torchrl.system.foreign import Foreign, read_json
from warp_torchrl.system.foreign_yaml import read_yaml

_MISSING = "not there"
_MAY_CHANGE = ("total_frames", "resume", "debug")
_NAMED = 3
_RENAMED = {"Direct": "InProcess", "Process": "MultiProcess"}  # classes, as earlier runs wrote them


@dataclass(frozen=True, kw_only=True)
class Resumption:
    """A run to resume.

    Attributes:
        found: The newest sound checkpoint.
        skipped: For each newer unsound checkpoint a line with the reason.
        saved_config: The saved configuration, with the new ``total_frames``.
        values: The full configuration as plain values.
        run_config: Its components, built.
        total_before: ``total_frames`` of the checkpoint.
        is_finished: Whether the run was trained to its end and evaluated.
    """

    found: Checkpoint
    skipped: list[str]
    saved_config: SavedConfig
    values: dict[str, Any]
    run_config: RunConfig
    total_before: int
    is_finished: bool


def resumption(
    folder: Path, total_frames: Any = None, build: Callable[[Mapping[str, Any]], RunConfig] = run_config
) -> Resumption:
    """Return the checkpoint and the configuration from which a run resumes.

    Args:
        folder: The run folder.
        total_frames: The new total; None takes that of ``config.yaml``, or else of the checkpoint.
        build: Builds the configuration.

    Raises:
        CheckpointError: If there is no sound checkpoint.
        ConfigError: If ``config.yaml`` differs from the checkpoint in more than the total, or the new total is already
            reached.
    """
    found, skipped = newest(folder)
    saved_config = found.saved_config()
    held, trained = read_config(folder / "config.yaml"), plain(restore(saved_config))
    _check_unedited(folder, held, saved_config, trained)
    before = trained["total_frames"]
    asked = total_frames if total_frames is not None else held.get("total_frames", before)
    values = plain(restore(replace(saved_config, values={**saved_config.values, "total_frames": asked})))
    made = build(values)
    frames, is_new = found.manifest.frames, total_frames is not None or made.total_frames != before
    if is_new and made.total_frames <= frames:
        raise ConfigError(f"total_frames must be more than the {frames} that {folder} has had, got {made.total_frames}")
    is_trained = found.manifest.mode is not None and frames >= made.total_frames
    return Resumption(
        found=found,
        skipped=skipped,
        saved_config=replace(saved_config, values={**saved_config.values, "total_frames": made.total_frames}),
        values=values,
        run_config=made,
        total_before=before,
        is_finished=is_trained and _evaluated(folder / "evaluation.json") == frames,
    )


def is_run_of(folder: Path, config: str) -> bool:
    """Return whether a folder holds the run of a configuration: all values are the same, ``debug`` aside.

    ``processes=auto`` is what the run was begun with: a queue may start it again where there are other cores.

    Args:
        folder: The run folder.
        config: What would be written into its ``config.yaml``.

    Raises:
        ConfigError: If its ``config.yaml`` cannot be read.
    """
    held, asked = read_config(folder / "config.yaml"), yaml.safe_load(config)
    aside = ("resume", "debug", *(["processes"] if asked["processes"] == "auto" else []))
    held, asked = ({key: value for key, value in each.items() if key not in aside} for each in (held, asked))
    return held == asked


def _evaluated(path: Path) -> int | None:
    """Return the frames of the policy in a run's ``evaluation.json``; None if there is no evaluation."""
    try:
        frames = read_json(path, LARGEST_EVALUATION)["frames"]
    except (OSError, Foreign, KeyError, TypeError):
        return None
    return frames if isinstance(frames, int) else None


# Edits of config.yaml


def read_config(path: Path) -> dict[str, Any]:
    """Return the content of a ``config.yaml``, not resolved or instantiated; empty if there is no file.

    Raises:
        ConfigError: If the file cannot be read.
    """
    if not path.exists():
        return {}
    try:
        content, reason = read_yaml(path), ""
    except Foreign as error:
        content, reason = None, f"; {error}"
    if not isinstance(content, dict):
        told = "must be as the run wrote it; without it resume takes what the checkpoint holds"
        raise ConfigError(f"{path} {told}{reason}")
    return {str(key): value for key, value in content.items()}


def _check_unedited(
    folder: Path, held: Mapping[str, Any], saved_config: SavedConfig, trained: Mapping[str, Any]
) -> None:
    found = edits(held, saved_config.values) + _other_classes(held, trained) if held else []
    if found:
        more = f", and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
        raise ConfigError(
            f"{folder / 'config.yaml'} is not what the checkpoint was trained with: {', '.join(found[:_NAMED])}{more}; "
            f"put it back to resume, or begin anew from its networks with start_from={folder} and what is to change"
        )


def edits(held: Mapping[Any, Any], trained: Mapping[str, Any], prefix: str = "") -> list[str]:
    """Return a text for each key whose value differs between a ``config.yaml`` and a saved configuration."""
    held = {str(key): value for key, value in held.items() if key != "_target_"}
    found = []
    for key in sorted({*held, *trained} - {*(() if prefix else _MAY_CHANGE)}):
        there, here = held.get(key, _MISSING), trained.get(key, _MISSING)
        if isinstance(there, Mapping) and isinstance(here, Mapping):
            found += edits(there, here, f"{prefix}{key}.")
        elif not _is_same(there, here):
            found.append(f"{prefix}{key} is {_shown(there)} and was {_shown(here)}")
    return found


def _other_classes(held: Mapping[str, Any], trained: Mapping[str, Any]) -> list[str]:
    """Return a text for each component whose class differs; its module may differ."""

    def name(node: Any) -> str:
        written = str(node.get("_target_")).rpartition(".")[2] if isinstance(node, Mapping) else ""
        return _RENAMED.get(written, written)

    pairs = {group: (name(held.get(group)), name(trained[group])) for group in COMPONENTS if group in held}
    return [f"{group} is {there} and was {here}" for group, (there, here) in pairs.items() if there != here]


def _is_same(there: Any, here: Any) -> bool:
    if isinstance(there, list) and isinstance(here, list):
        return len(there) == len(here) and all(map(_is_same, there, here))
    if isinstance(there, str) and isinstance(here, (int, float)):  # YAML reads 1e-3 as text
        try:
            there = float(there)
        except ValueError:
            return False
    return isinstance(there, bool) == isinstance(here, bool) and there == here


def _shown(value: Any) -> str:
    return value if value is _MISSING else reprlib.repr(value)
