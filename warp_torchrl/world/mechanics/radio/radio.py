"""A team's radio: what it carries, who hears whom, and when."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.batch import Named
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.mechanics.mechanic import Mechanic, Rules
from warp_torchrl.world.mechanics.radio.packets import Packets, moved_up
from warp_torchrl.world.mechanics.table import mechanic
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.hearing import HEARING, Hearing

MAST = 3.0
"""Height of a ground vehicle's antenna over the ground [m]."""
ALTITUDE = 100.0
"""Height at which aircraft fly over the ground [m]."""
_SAMPLES = 16
"""Points of a line of sight at which it is compared with the ground."""


@mechanic(HEARING)
@dataclass(frozen=True, kw_only=True)
class Radio(Hearing, Mechanic):
    """The radio of a team: packets set out in each step before agents look, and are told.

    Attributes:
        carries: What it carries each step: ``map``, what agents know of the fire, to those that hear them; ``graph``,
            the messages of networks (``model.messages``, which sets it), for which agents are shown whom they hear and
            where those are; ``both``, or ``none``.
        range: How far agents hear each other, by Euclidean distance [cells]; None is everywhere, 0 not at all.
        loss: Chance that a packet is lost, drawn for each pair of agents and step.
        line_of_sight: Whether hills between two antennas keep them from hearing each other.
        delay: Whole steps that a packet is under way. It reaches those that heard its sender when it was sent.

    Raises:
        ValueError: If a value is out of its range.
    """

    is_knowledge: ClassVar[bool] = True

    carries: Literal["none", "map", "graph", "both"] = "none"
    range: float | None = None
    loss: float = 0.0
    line_of_sight: bool = False
    delay: int = 0

    def __post_init__(self) -> None:
        check_fields(self, range=(0.0, 1e6), loss=(0.0, 1.0), delay=(0, 64))

    @property
    def sends_maps(self) -> bool:
        """Return whether agents tell each other what they know of the fire."""
        return self.carries in ("map", "both")

    @property
    def sends_vectors(self) -> bool:
        """Return whether agents' networks send messages to each other."""
        return self.carries in ("graph", "both")

    @property
    def is_late(self) -> bool:
        """Return whether packets arrive steps after they were sent."""
        return self.delay > 0

    @property
    def is_everywhere(self) -> bool:
        """Return whether every packet reaches every agent at once."""
        return self.range is None and not (self.loss or self.line_of_sight or self.delay)

    def check(self, world: Rules) -> None:
        """Check that it sends no maps to agents that know all of them.

        Raises:
            ValueError: If it does.
        """
        if self.sends_maps and not world.sensing.is_limited:
            raise ValueError(
                f"mechanics.radio.carries must be none or graph where agents see all (sensing=full), got {self.carries}"
            )

    def why_eager(self) -> str | None:
        """Return that steps with packets that come late are not compiled."""
        return "a step of a team whose packets come late is not compiled" if self.is_late else None

    def heard(self, state: WorldState, flies: Tensor) -> Tensor:
        """Return who hears what is sent now, bool [B, A, A]: [b, i, j] where agent i hears agent j; none hears itself.

        Agents hear those within ``range``, along a line of sight over the terrain if ``line_of_sight``, but for the
        packets that are lost: each with chance ``loss``, drawn for each pair and step.

        Args:
            state: The worlds.
            flies: Which agents fly, bool [A].
        """
        links, agents = super().arriving(state, flies), state.vehicles.position.shape[1]
        if self.range is not None:
            apart = (state.vehicles.position[:, :, None] - state.vehicles.position[:, None]).to(torch.float32)
            near = apart.square().sum(-1) <= self.range**2
            links = links & near if self.range > 0.0 else torch.zeros_like(near)
        if self.line_of_sight and state.landscape.elevation is not None:
            links = links & _in_line_of_sight(state, state.landscape.elevation, flies)
        if self.loss > 0.0:
            links = links & (uniform(state.key, state.step, Stream.RADIO, (agents, agents)) >= self.loss)
        return links

    def begin(self, state: WorldState, world: Rules) -> WorldState:
        """Return worlds at the start of an episode, with the packets that set out then and nothing before them."""
        if not self.is_late:
            return state
        position, size = state.vehicles.position, state.cells.shape[1:]
        steps = (len(position), self.delay + 1, position.shape[1])
        packets = Packets(
            links=state.done.new_zeros(*steps, position.shape[1]),
            places=position.new_zeros(*steps, 2),
            maps=state.step.new_zeros(*steps, *size) if self.sends_maps else None,
        )
        return self.step(state, state.with_planes(self.name, packets), torch.ones_like(state.done), world)

    def step(self, before: WorldState, after: WorldState, running: Tensor, world: Rules) -> WorldState:
        """Return worlds after a step with the packets that set out then, in those that go on, bool [B].

        Who will hear them is settled now. What is in them those add who make it: ``told``, ``with_shown``.
        """
        if not self.is_late:
            return after
        links = self.heard(after, world.team.table(after.cells.device).flies)
        packets = self._under_way(after).sent(running, links=links, places=after.vehicles.position)
        return after.with_planes(self.name, packets)

    def told(self, state: WorldState, maps: Tensor, flies: Tensor, running: Tensor) -> tuple[WorldState, Tensor]:
        """Return worlds whose agents have sent their maps, and the newest records that reach each agent now."""
        if self.is_late:
            packets = self._under_way(state).sent(running, maps=maps)
            state, maps = state.with_planes(self.name, packets), packets.arriving("maps")
        return state, torch.where(self.arriving(state, flies)[..., None, None], maps[:, None], 0).amax(dim=2)

    def with_shown(self, state: WorldState, shown: Mapping[str, Tensor], running: Tensor) -> WorldState:
        """Return worlds whose agents have sent what messages are made of: what they observe, [B, A, ...] by name.

        Before the first there are zeros, which nobody hears.
        """
        if not (self.is_late and self.sends_vectors):
            return state
        packets, steps = self._under_way(state), self.delay + 1
        before = {name: each.new_zeros(len(each), steps, *each.shape[1:]) for name, each in shown.items()}
        before = before if packets.shown is None else packets.shown.held
        after = Named({name: moved_up(before[name], each, running) for name, each in shown.items()})
        return state.with_planes(self.name, packets.replace(shown=after))

    def arriving(self, state: WorldState, flies: Tensor) -> Tensor:
        """Return whose packets reach whom now, bool [B, A, A]."""
        return self._under_way(state).arriving("links") if self.is_late else self.heard(state, flies)

    def places(self, state: WorldState) -> Tensor:
        """Return where agents were when they sent what arrives now, int64 [B, A, 2], in cells."""
        return self._under_way(state).arriving("places") if self.is_late else state.vehicles.position

    def shown(self, state: WorldState) -> dict[str, Tensor]:
        """Return what agents observed when they sent what arrives now, [B, A, ...] by name; nothing without delay.

        Raises:
            ValueError: If the worlds do not tell it: they are of no environment, or of one of another delay.
        """
        if not (self.is_late and self.sends_vectors):
            return {}
        shown = self._under_way(state).shown
        if shown is None:
            raise ValueError("worlds must tell what their agents sent, as those of an environment do")
        return {name: steps[:, 0].clone() for name, steps in shown.held.items()}

    def _under_way(self, state: WorldState) -> Packets:
        """Return the packets, checked."""
        links = state.plane(self.name, "links")
        steps = 0 if links is None else links.shape[1]
        if steps != self.delay + 1:
            rule = f"worlds must have the packets of {self.delay + 1} steps where mechanics.radio.delay is {self.delay}"
            raise ValueError(f"{rule}, got {steps}")
        return state.planes(self.name, Packets)


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
