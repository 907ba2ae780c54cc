"""Hearing: which agents hear each other, and what reaches them. A radio sets limits to it, and carries more."""

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.presence import pairs_there

HEARING = "radio"
"""Name of what is under way, among the planes of the state."""


@dataclass(frozen=True, kw_only=True)
class Hearing:
    """All agents hear all others, wherever they are, at once: each knows where the others are, and nothing more.

    A mechanic of the world that is a ``Hearing`` too takes the place of this one, see ``World.hearing``.
    """

    @property
    def sends_maps(self) -> bool:
        """Return whether agents tell each other what they know of the fire."""
        return False

    @property
    def sends_vectors(self) -> bool:
        """Return whether agents' networks send messages to each other."""
        return False

    @property
    def is_late(self) -> bool:
        """Return whether packets arrive steps after they were sent."""
        return False

    @property
    def is_everywhere(self) -> bool:
        """Return whether every packet reaches every agent at once."""
        return True

    def arriving(self, state: WorldState, flies: Tensor) -> Tensor:
        """Return whose packets reach whom now, bool [B, A, A]: [b, i, j] where agent i gets what agent j sent.

        Args:
            state: The worlds.
            flies: Which agents fly, bool [A].
        """
        others = ~torch.eye(state.vehicles.position.shape[1], dtype=torch.bool, device=state.cells.device)
        return pairs_there(state, others.expand(len(state.cells), -1, -1))

    def places(self, state: WorldState) -> Tensor:
        """Return where agents were when they sent what arrives now, int64 [B, A, 2], in cells."""
        return state.vehicles.position

    def told(self, state: WorldState, maps: Tensor, flies: Tensor, running: Tensor) -> tuple[WorldState, Tensor]:
        """Return worlds whose agents have sent their maps, and the newest records that reach each agent now.

        Args:
            state: The worlds.
            maps: What agents know now, int32 [B, A, H, W].
            flies: Which agents fly, bool [A].
            running: Worlds that go on, bool [B].

        Returns:
            The worlds, and records int32 [B, A, H, W]; 0 where none reach the agent.
        """
        return state, torch.zeros_like(maps)

    def with_shown(self, state: WorldState, shown: Mapping[str, Tensor], running: Tensor) -> WorldState:
        """Return worlds whose agents have sent what messages are made of: what they observe, [B, A, ...] by name."""
        return state

    def shown(self, state: WorldState) -> dict[str, Tensor]:
        """Return what agents observed when they sent what arrives now, [B, A, ...] by name; nothing if not late."""
        return {}

    def observed(self, state: WorldState, flies: Tensor) -> Tensor:
        """Return what agents are shown of those whom they hear, float32 [B, A, A, 3].

        Of each agent and each other: 1 where a packet of the other arrives, else 0; and rows and columns [cells] from
        where it is now to where the other was when it sent that, 0 where none arrives. An agent knows its own place,
        and the packet tells its sender's.

        Args:
            state: The worlds.
            flies: Which agents fly, bool [A].
        """
        hears = self.arriving(state, flies)[..., None].to(torch.float32)
        offset = self.places(state)[:, None] - state.vehicles.position[:, :, None]
        return torch.cat((hears, hears * offset), dim=-1)
