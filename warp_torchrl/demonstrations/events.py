"""Events: people's changes to a world in the middle of an episode."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import torch
from tensordict import TensorDictBase
from torch import Tensor

from warp_torchrl.env import WildfireEnv
from warp_torchrl.world.air.wind import constant_wind
from warp_torchrl.world.backends.tick import in_wind
from warp_torchrl.world.ignition.intervention import cleared, ignited


@dataclass(frozen=True, kw_only=True)
class Event:
    """One of ``EVENT_KINDS``, before a step.

    Attributes:
        step: The step that it came before, 0 for the first.
        kind: ``ignite`` and ``clear`` a cell; or ``blow``, which holds one wind over the whole map.
        numbers: Row and column of the cell; or speed [m/s] and where the air goes, degrees from east,
            counter-clockwise.

    Raises:
        ValueError: If the kind is unknown or a number is not finite.
    """

    step: int
    kind: str
    numbers: tuple[float, float]

    def __post_init__(self) -> None:
        if self.kind not in EVENT_KINDS or type(self.step) is not int or self.step < 0:
            raise ValueError(
                f"an event must be one of {', '.join(EVENT_KINDS)} at a step, got {self.kind} at {self.step}"
            )
        if len(self.numbers) != 2 or not all(math.isfinite(each) for each in self.numbers):
            raise ValueError(f"{self.kind} must have two finite numbers, got {self.numbers}")


def carry_out(env: WildfireEnv, event: Event) -> TensorDictBase:
    """Apply an event to every world of an environment, where possible, and return the new observations.

    Raises:
        ValueError: If a wind is out of its range, or a cell is not on the map.
    """
    return EVENT_KINDS[event.kind](env, *event.numbers)


def at_cell(env: WildfireEnv, row: float, column: float) -> Tensor:
    """Return where a cell is, bool [B, H, W].

    Raises:
        ValueError: If it is not on the map.
    """
    height, width = env.world.size
    if not (0 <= row < height and 0 <= column < width):
        raise ValueError(f"cell {row:g}, {column:g} is not on the map of {height} x {width} cells")
    here = torch.zeros_like(env.shared_state.cells, dtype=torch.bool)
    here[:, int(row), int(column)] = True
    return here


def _ignite(env: WildfireEnv, row: float, column: float) -> TensorDictBase:
    return env.set_state(ignited(env.shared_state, env.world.fire, at_cell(env, row, column)))


def _clear(env: WildfireEnv, row: float, column: float) -> TensorDictBase:
    return env.set_state(cleared(env.shared_state, at_cell(env, row, column)))


def _blow(env: WildfireEnv, speed: float, direction: float) -> TensorDictBase:
    turn = math.radians(direction)
    u, v = speed * math.cos(turn), speed * math.sin(turn)
    env.world = replace(env.world, wind=constant_wind(u, v))
    return env.set_state(in_wind(env.shared_state, env.world.fire, torch.tensor([u, v]).view(1, 2, 1, 1)))


EVENT_KINDS: Mapping[str, Callable[[WildfireEnv, float, float], TensorDictBase]] = {
    "ignite": _ignite,
    "clear": _clear,
    "blow": _blow,
}
"""What people can do to a world, by name."""
