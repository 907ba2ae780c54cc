"""The teachers of a training, for its history: names, and world steps of trained ones."""

from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.history import Teacher, teacher_names, trained_steps
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.system.foreign_text import plain_text


def teachers_of(values: Mapping[str, Any]) -> tuple[Teacher, ...]:
    """Return the teachers that a training's configuration names, a folder by its last name.

    Raises:
        CheckpointError: If a folder holds no sound checkpoint.
    """
    return tuple(_teacher(name) for name in teacher_names(values))


def _teacher(name: str) -> Teacher:
    short = plain_text(PurePath(name).name)
    if name in HEURISTICS or name == "people":
        return Teacher(name=short)
    found, _ = checkpoints.newest(find_policy(name))
    return Teacher(name=short, steps=trained_steps(found.history))
