"""A team's radio: what it carries, and who hears whom."""

from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.random import Stream, uniform
from warp_torchrl.world.state import WorldState

MAST = 3.0
"""Height of a ground vehicle's antenna over the ground [m]."""
ALTITUDE = 100.0
"""Height at which aircraft fly over the ground [m]."""
_SAMPLES = 16
"""Points of a line of sight at which it is compared with the ground."""


@dataclass(frozen=True, kw_only=True)
class Radio:
    """The radio of a team.

    Attributes:
        carries: What it carries each step: ``map``, what agents know of the fire, to those that hear them; ``graph``,
            the messages of networks (``model.messages``, which sets it), for which agents are shown whom they hear and
            where those are; ``both``, or ``none``.
        range: How far agents hear each other, by Euclidean distance [cells]; None is everywhere, 0 not at all.
        loss: Chance that a packet is lost, drawn for each pair of agents and step.
        line_of_sight: Whether hills between two antennas keep them from hearing each other.

    Raises:
        ValueError: If a value is out of its range.
    """

    carries: Literal["none", "map", "graph", "both"] = "none"
    range: float | None = None
    loss: float = 0.0
    line_of_sight: bool = False

    def __post_init__(self) -> None:
        check_fields(self, range=(0.0, 1e6), loss=(0.0, 1.0))

    @property
    def sends_maps(self) -> bool:
        """Return whether agents tell each other what they know of the fire."""
        return self.carries in ("map", "both")

    @property
    def sends_vectors(self) -> bool:
        """Return whether agents' networks send messages to each other."""
        return self.carries in ("graph", "both")

    def heard(self, state: WorldState, flies: Tensor) -> Tensor:
        """Return which agents hear which, bool [B, A, A]: [b, i, j] where agent i hears agent j; none hears itself.

        Agents hear those within ``range``, along a line of sight over the terrain if ``line_of_sight``, but for the
        packets that are lost: each with chance ``loss``, drawn for each pair and step.

        Args:
            state: The worlds.
            flies: Which agents fly, bool [A].
        """
        agents = state.vehicles.position.shape[1]
        others = ~torch.eye(agents, dtype=torch.bool, device=state.cells.device)
        links = others.expand(len(state.cells), -1, -1)
        if self.range is not None:
            apart = (state.vehicles.position[:, :, None] - state.vehicles.position[:, None]).to(torch.float32)
            near = apart.square().sum(-1) <= self.range**2
            links = links & near if self.range > 0.0 else torch.zeros_like(near)
        if self.line_of_sight and state.landscape.elevation is not None:
            links = links & _in_line_of_sight(state, state.landscape.elevation, flies)
        if self.loss > 0.0:
            links = links & (uniform(state.key, state.step, Stream.RADIO, (agents, agents)) >= self.loss)
        return links

    def observed(self, state: WorldState, flies: Tensor) -> Tensor:
        """Return what agents are shown of those whom they hear, float32 [B, A, A, 3].

        Of each agent and each other: 1 where it hears it, else 0; and rows and columns from it to the other [cells], 0
        where it does not hear it.

        Args:
            state: The worlds.
            flies: Which agents fly, bool [A].
        """
        hears = self.heard(state, flies)[..., None].to(torch.float32)
        position = state.vehicles.position
        return torch.cat((hears, hears * (position[:, None] - position[:, :, None])), dim=-1)


def _in_line_of_sight(state: WorldState, elevation: Tensor, flies: Tensor) -> Tensor:
    """Return between which agents no ground stands in the way, bool [B, A, A]."""
    position, width = state.vehicles.position, elevation.shape[2]
    ground = elevation.flatten(1)
    own = ground.gather(1, position[..., 0] * width + position[..., 1]) + torch.where(flies, ALTITUDE, MAST)
    share = (torch.arange(_SAMPLES, device=position.device) + 0.5) / _SAMPLES
    here, there = position[:, :, None, None].to(torch.float32), position[:, None, :, None].to(torch.float32)
    along = (here + (there - here) * share[:, None]).round().to(torch.int64)  # [B, A, A, S, 2]
    between = ground.gather(1, (along[..., 0] * width + along[..., 1]).flatten(1)).view(along.shape[:-1])
    line = own[:, :, None, None] + (own[:, None, :, None] - own[:, :, None, None]) * share
    return (between <= line).all(dim=-1)
