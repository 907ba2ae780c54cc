"""What agents may be shown: a preset is a component.

Its ``spaces`` tell the environment the shape, type and range of each entry, and called with a state it returns them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import torch
from torch import Tensor

from warp_torchrl.entries import Content, Planes, Target, Vector
from warp_torchrl.env.observation.advice import check_adviser
from warp_torchrl.env.observation.channels import CHANNELS, DEFAULT, ages, check_channels, stages
from warp_torchrl.env.observation.coarse_picture import PICTURE, PICTURE_SIDE, centred_picture, picture
from warp_torchrl.env.observation.critic import STATE, CriticState
from warp_torchrl.env.observation.features import (
    NOTHING_MORE,
    Choice,
    Feature,
    Features,
    check_features,
    content_of,
    first_of,
    highs_of,
    names_of,
    parts_of,
)
from warp_torchrl.env.observation.status import STATUS, status_vector
from warp_torchrl.env.observation.view import egocentric_view
from warp_torchrl.env.observation.ways import check_ways
from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.squares import window
from warp_torchrl.world.state.records import read, records_of
from warp_torchrl.world.state.state import Forecast, WorldState
from warp_torchrl.world.world import World


class Space(NamedTuple):
    """Shape (one agent's), type and range of an entry of an observation."""

    shape: tuple[int, ...]
    dtype: torch.dtype
    low: float
    high: float | tuple[float, ...]  # of all numbers, or one for each channel
    names: tuple[str, ...] = ()  # of the channels of a map or the entries of a vector, where they have any
    symmetry: Planes | Vector | None = None  # how it turns with the map; None: networks read it north up alone
    content: tuple[Content, ...] = ()  # of each channel of a map, what it can hold in this world; (): anything

    def bounds(self) -> tuple[Tensor, Tensor]:
        """Return the least and the largest value of each number, both of the entry's shape and type."""
        low, high = torch.full(self.shape, self.low, dtype=self.dtype), torch.tensor(self.high, dtype=self.dtype)
        per_channel = high.view(-1, *[1] * (len(self.shape) - 1)) if high.ndim else high
        return low, per_channel.expand(self.shape).contiguous()


@dataclass(frozen=True, kw_only=True)
class Local:
    """What an agent sees of its own surroundings, and nothing else.

    ``view`` is the square of 2 r + 1 cells about the agent, north up, uint8, in channels that are chosen by name from
    ``observation.channels.CHANNELS``. ``status`` is what it knows of itself: numbers of ``observation.status.STATUS``.

    Attributes:
        radius: r [cells].
        identity: Whether ``status`` tells the agent's place in its team, see ``identity``: agents that stand together
            and see the same can then part.
        rules: Whether ``status`` tells the rules of the world, see ``rules_of``: one policy can then play by several.
        water: Whether ``status`` tells the way to the nearest water, see ``way_to_water``: else agents whose tanks are
            empty know of lakes within their view alone.
        ways: Further ways that ``status`` tells, of ``fire``, ``share`` and ``search``, see ``ways``: agents can then
            do without a picture of the whole map.
        advice: Name of a heuristic, one of ``TEACHERS``, that tells each agent, in ``status``, the action that it would
            choose for it, see ``advised_actions``: agents may do otherwise; None has no adviser.
        reach: Whether the central critic's ``state`` tells how soon fire and team can be where, see
            ``critic.reach_of_fire_and_team``: else it cannot tell a closed firebreak from one that lacks a cell.
        features: Names of further channels of the view, numbers of ``status`` and planes of the critic's ``state``, in
            order: maps of mechanics, and what modules of a user's own add.
        channels: Names of the view's channels, in order.

    Raises:
        ValueError: If the radius is not in 1..32, or a channel, a feature, a way or the adviser is unknown.
    """

    radius: int = 5
    identity: bool = True
    rules: bool = False
    water: bool = False
    ways: tuple[str, ...] = ()
    advice: str | None = None
    reach: bool = False
    features: tuple[str, ...] = ()
    channels: tuple[str, ...] = DEFAULT
    tables: ClassVar[tuple[Features, ...]] = (CHANNELS, STATUS, STATE)
    """Of features that may be chosen."""

    def __post_init__(self) -> None:
        check_fields(self, radius=(1, 32))
        check_channels(self.channels)
        check_features(self.features, self.tables)
        check_ways(self.ways)
        if self.advice is not None:
            check_adviser(self.advice)

    def spaces(self, world: World) -> dict[str, Space]:
        """Return the space of each entry."""
        side, names = 2 * self.radius + 1, self.view_names
        features = [CHANNELS[name] for name in names]
        own = Vector(parts_of(STATUS.shown(world, self.choice), world))
        shape, highs = (len(features), side, side), tuple(each.high for each in features)
        symmetry, content = Planes(len(features), target_of(features, world)), content_of(features, world)
        return {
            "view": Space(shape, torch.uint8, 0, highs, names, symmetry, self._content_of(content)),
            "status": Space((len(own.names),), torch.float32, -3.0, 3.0, own.names, own),
        }

    def __call__(self, state: WorldState, world: World, forecast: Forecast) -> dict[str, Tensor]:
        """Return ``view`` uint8 [B, A, C, V, V] and ``status`` float32 [B, A, F]."""
        own = status_vector(state, world, forecast, self.choice)
        return {"view": egocentric_view(state, world, forecast, self.radius, self.view_names), "status": own}

    @cached_property
    def view_names(self) -> tuple[str, ...]:
        """Return the names of the view's channels, in order."""
        return (*self.channels, *(name for name in self.features if name in CHANNELS and name not in self.channels))

    @cached_property
    def choice(self) -> Choice:
        """Return what is shown beside what every observation shows."""
        return Choice(
            identity=self.identity,
            rules=self.rules,
            water=self.water,
            ways=self.ways,
            advice=self.advice or "",
            reach=self.reach,
            features=self.features,
        )

    def _content_of(self, content: tuple[Content, ...]) -> tuple[Content, ...]:
        """Return what channels can hold; nothing for a subclass that redefines how they are shown."""
        return content if type(self).__call__.__module__ == __name__ else ()


@dataclass(frozen=True, kw_only=True)
class Surroundings(Local):
    """An agent's own surroundings and the state of the fire, as the paper has it: the default.

    As ``Local``, and ``picture``: what a dispatcher would radio, the whole map's fire (square root of the share of
    each block that burns), fuel and team-mates in 8 x 8 blocks: channels of ``observation.coarse_picture.PICTURE``.
    ``features`` may name further ones; of a map of a mechanic it shows the square root of each block's mean.

    Attributes:
        centred: Whether the agent's own block is the middle of the picture, which then has 15 x 15 blocks, uint8; else
            it is of the map, 8 x 8 blocks, float32.
        near: Side of the blocks of a second picture, ``near``, of 15 x 15 blocks about the agent whatever the map's
            size [cells]: on large maps the blocks of ``picture`` are too coarse to find a fire by; 0 shows none.

    Raises:
        ValueError: If the radius is not in 1..32, or near not in 0..64.
    """

    centred: bool = True
    near: int = 0
    tables: ClassVar[tuple[Features, ...]] = (*Local.tables, PICTURE)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, near=(0, 64))

    def spaces(self, world: World) -> dict[str, Space]:
        """Return the space of each entry."""
        found = {**super().spaces(world), "picture": self._picture(world, self.centred, order=2 if self.near else 1)}
        if self.near:
            found["near"] = self._picture(world, centred=True, order=1)
        return found

    def __call__(self, state: WorldState, world: World, forecast: Forecast) -> dict[str, Tensor]:
        """Return ``view``, ``status`` and ``picture``: uint8 [B, A, C, 15, 15]; of the map, float32 [B, A, C, 8, 8].

        And ``near`` if it is shown, uint8 [B, A, C, 15, 15].
        """
        show = centred_picture if self.centred else picture
        shown = show(state, world, forecast, self.choice)
        found = {**super().__call__(state, world, forecast), "picture": shown}
        if self.near:
            side = max(1, round(max(world.size) / self.near))
            found["near"] = centred_picture(state, world, forecast, self.choice, side)
        return found

    def _picture(self, world: World, centred: bool, order: int) -> Space:
        """Return the space of a picture, whose fire is of an order among what shows fire; that of the view is 0."""
        features = PICTURE.shown(world, self.choice)
        names, side = names_of(features, world), 2 * PICTURE_SIDE - 1 if centred else PICTURE_SIDE
        target = target_of(features, world, order=order, near=0.5, is_share=True, in_middle=centred)
        return Space(
            (len(names), side, side),
            torch.uint8 if centred else torch.float32,
            0,
            highs_of(features, world) if centred else 1.0,
            names,
            Planes(len(names), target),
            self._content_of(content_of(features, world)),
        )


@dataclass(frozen=True, kw_only=True)
class Paper:
    """The paper's view: terrain class, tree age and fire stage about the agent, flattened.

    Off the map the terrain class is 0 and the others too; covers are (code + 1) / 5, ages / 10.2, fire stages / 5.

    Attributes:
        radius: r of the view [cells]; the vector has 3 (2 r + 1)^2 entries.

    Raises:
        ValueError: If the radius is not in 1..32.
    """

    radius: int = 3

    def __post_init__(self) -> None:
        check_fields(self, radius=(1, 32))

    def spaces(self, world: World) -> dict[str, Space]:
        """Return the space of the one, nameless entry."""
        return {"": Space((3 * (2 * self.radius + 1) ** 2,), torch.float32, 0.0, 1.0, symmetry=PAPER_SYMMETRY)}

    def __call__(self, state: WorldState, world: World, forecast: Forecast) -> dict[str, Tensor]:
        """Return one entry, float32 [B, A, 3 (2 r + 1)^2]."""
        seen = window(state.vehicles.position, state.cells.shape[1:], self.radius)
        records = records_of(state)
        cells = seen.of(state.cells) if records is None else read(seen.of_own(records))[0]
        cover = (seen.of(state.landscape.cover) + seen.inside) * 51
        view = torch.stack((cover, ages(cells), stages(cells)), dim=2)
        return {"": view.flatten(2).to(torch.float32).mul_(1.0 / 255.0)}


PAPER_SYMMETRY = Planes(3, Target(2), is_flat=True)
"""How the paper's view turns with the map; its last channel shows fire."""


def target_of(features: Sequence[Feature], world: World, **options: Any) -> Target | None:
    """Return what agents turn towards among features, None where none shows it; see ``Target`` for the options."""
    found = first_of("target", features, world)
    return None if found is None else Target(found[0], **options)


Observation = Surroundings | Local | Paper
"""Any observation preset."""


def searched_for(observation: Observation) -> str | None:
    """Return the key of what the map is searched for in every step, which is neither compiled nor recorded; or None."""
    if not isinstance(observation, Local):
        return None
    return "advice" if observation.advice is not None else "reach" if observation.reach else None


OF_CRITIC = ("reach",)
"""Keys of presets that tell the central critic and no agent."""


def critic_state(observation: Observation, world: World) -> CriticState:
    """Return what the central critic sees of worlds where agents see this."""
    return CriticState(world, observation.choice if isinstance(observation, Local) else NOTHING_MORE)
