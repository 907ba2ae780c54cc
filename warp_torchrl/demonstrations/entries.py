"""Schema of a recording's steps: names, dtypes, shapes and ranges of its entries."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import prod
from typing import Any

import torch
from tensordict import TensorDictBase

from warp_torchrl.demonstrations.recording import MOVER, PROPOSED, ROLE, Mover
from warp_torchrl.models import ACTION, ACTION_MASK, OBSERVATION, REWARD
from warp_torchrl.system.finite import not_finite
from warp_torchrl.world.state.role import PAPER_ROLES

DTYPES = {str(each).removeprefix("torch."): each for each in (torch.bool, torch.uint8, torch.int64, torch.float32)}
_OBSERVATION = "/".join(OBSERVATION)
_MOST_DIMENSIONS = 6


@dataclass(frozen=True, kw_only=True)
class Layout:
    """How many steps, agents and actions a recording has.

    Attributes:
        steps: T.
        agents: A.
        actions: Number of actions.
    """

    steps: int
    agents: int
    actions: int

    def check(self, entries: Mapping[str, Any]) -> dict[str, tuple[torch.dtype, tuple[int, ...]]]:
        """Return the type and shape of each entry of a manifest, by its name with slashes.

        Raises:
            ValueError: If an entry is unknown or missing, or its type or shape is another than it must be.
        """
        known = self._known()
        found = {name: _described(name, entry) for name, entry in entries.items()}
        for name, (dtype, shape) in found.items():
            if name not in known and not _is_observation(name):
                raise ValueError(f"entry {name[:80]!r} is none of a recording")
            wanted = known.get(name, (dtype, (self.steps, self.agents, *shape[2:])))
            if (dtype, shape) != wanted or len(shape) < 2:
                raise ValueError(f"entry {name} must be {_words(*wanted)}, got {_words(dtype, shape)}")
        needed = {*known, _OBSERVATION} - {"/".join(ROLE)}
        there = {_OBSERVATION if name.startswith(f"{_OBSERVATION}/") else name for name in found}
        if needed - there:
            raise ValueError(f"entry {min(needed - there)} is missing")
        return found

    def _known(self) -> dict[str, tuple[torch.dtype, tuple[int, ...]]]:
        team, once = (self.steps, self.agents), (torch.bool, (self.steps, 1))
        known = {
            ACTION: (torch.int64, team),
            PROPOSED: (torch.int64, team),
            ROLE: (torch.int64, team),
            MOVER: (torch.uint8, team),
            ACTION_MASK: (torch.bool, (*team, self.actions)),
            ("next", *REWARD): (torch.float32, (*team, 1)),
            ("next", "done"): once,
            ("next", "terminated"): once,
            ("next", "truncated"): once,
        }
        return {"/".join(key): value for key, value in known.items()}

    def check_numbers(self, steps: TensorDictBase) -> None:
        """Check the numbers of a recording's steps.

        Raises:
            ValueError: If one is none that an environment can have shown, or an agent done.
        """
        for name, value in leaves(steps):
            if value.dtype is torch.bool and int(value.view(torch.uint8).max()) > 1:
                raise ValueError(f"{name} must hold true and false alone")
            if (number := not_finite(value)) is not None:
                raise ValueError(f"{name} must hold finite numbers alone, got {number:g}")
        highest = {
            ACTION: self.actions,
            PROPOSED: self.actions,
            ROLE: len(PAPER_ROLES) + self.agents,
            MOVER: len(Mover),
        }
        for key, count in highest.items():
            value = steps.get(key, None)
            if value is not None and not (int(value.min()) >= 0 and int(value.max()) < count):
                raise ValueError(f"{key[-1]} must be one of {count} everywhere, from 0")
        if not bool(steps[ACTION_MASK].any(-1).all()):
            raise ValueError("the mask must leave each agent an action in every step")
        if bool(steps["next", "done"][:-1].any()):
            raise ValueError("the episode must end with the last step, and ends before it")


def leaves(steps: TensorDictBase) -> Iterator[tuple[str, torch.Tensor]]:
    """Yield the tensors of steps by their names with slashes."""
    for key, value in steps.items(include_nested=True, leaves_only=True):
        yield key if isinstance(key, str) else "/".join(key), value


def entry_size(dtype: torch.dtype, shape: tuple[int, ...]) -> int:
    """Return the size of an entry's file [bytes]."""
    return prod(shape) * dtype.itemsize


def _is_observation(name: str) -> bool:
    whole, _, part = name.partition(f"{_OBSERVATION}/")
    return name == _OBSERVATION or (not whole and part.isascii() and part.isidentifier())


def _described(name: str, entry: Any) -> tuple[torch.dtype, tuple[int, ...]]:
    dtype, shape = (entry.get("dtype"), entry.get("shape")) if isinstance(entry, dict) else (None, None)
    if not isinstance(dtype, str) or dtype not in DTYPES:
        raise ValueError(f"entry {name[:80]!r} must be of type {', '.join(DTYPES)}, got {dtype!r:.80}")
    if not isinstance(shape, list) or len(shape) > _MOST_DIMENSIONS or not all(map(_is_side, shape)):
        raise ValueError(f"entry {name[:80]!r} must have a shape, got {shape!r:.80}")
    return DTYPES[dtype], tuple(shape)


def _is_side(value: object) -> bool:
    return type(value) is int and value > 0


def _words(dtype: torch.dtype, shape: tuple[int, ...]) -> str:
    return f"{str(dtype).removeprefix('torch.')} {list(shape)}"
