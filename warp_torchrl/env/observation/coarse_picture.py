"""The whole map in blocks, what a dispatcher would radio: a table of channels by name.

A channel reads ``Blocks``. A module of a user's own adds one, which ``observation.features`` chooses:

    @picture_channel()
    def assets(now: Blocks) -> Tensor:
        return now.show(block_means(..., now.side))
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from warp_torchrl.entries import Empty, Part
from warp_torchrl.env.observation.features import (
    NOTHING_MORE,
    Choice,
    Features,
    Function,
    Holds,
    IsThere,
    Map,
    add_maps,
    anything,
    everywhere,
    known_in_part,
)
from warp_torchrl.world.arrays.blocks import block_means
from warp_torchrl.world.arrays.squares import Window, window
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.records import freshness, kept, known_codes, records_of
from warp_torchrl.world.state.state import FIRST_FIRE, OLDEST, Forecast, WorldState
from warp_torchrl.world.team.places import block_at, block_of
from warp_torchrl.world.world import World

PICTURE_SIDE = 8
PICTURE = Features("channel of the picture")
"""All channels of the picture, by name and in order."""


class Blocks(NamedTuple):
    """What a channel of the picture reads: the worlds, and how their maps are shown in S x S blocks.

    Where agents keep records of the fire (``world.state.records``) a channel shows what each agent knows, and reads
    ``known``.
    """

    state: WorldState
    world: World
    forecast: Forecast
    side: int  # S
    about: Window | None  # the 15 x 15 blocks about each agent; None where the whole map is shown
    known: Tensor | None  # the cells' codes as each agent knows them, [B, A, H, W]; None where all is seen

    def show(self, shares: Tensor, high: int = 255) -> Tensor:
        """Return what shares in 0..1 show, [B, S, S] of the map or [B, A, S, S] of each agent's own.

        About the agents they are whole numbers 0..``high``, uint8 [B, A, 15, 15], 0 off the map; of the whole map
        float32 [B, A, S, S].
        """
        if self.about is None:
            return (shares if shares.ndim == 4 else shares[:, None]).expand(-1, self.world.team.n_agents, -1, -1)
        codes = (shares * high).to(torch.uint8)
        return self.about.of_own(codes) if codes.ndim == 4 else self.about.of(codes)


def picture_channel(
    high: int = 255,
    content: Holds = anything,
    is_there: IsThere | None = None,
    is_target: bool = False,
    parts: Callable[[World], Sequence[Part]] | None = None,
) -> Callable[[Function], Function]:
    """Return what adds a function to the table, under the function's name; it returns what ``Blocks.show`` does.

    Args:
        high: The largest number that it shows about the agents, at most 255.
        content: Returns what it can hold in a world, in a picture of channels by name.
        is_there: Returns whether a world shows it; None where an observation chooses it by name.
        is_target: Whether it shows what agents turn towards.
        parts: Of a function that returns several channels side by side, [B, A, n, ...], returns what they are called.

    Raises:
        ValueError: If the number is not in 1..255, or the table has another channel of that name.
    """

    def added(show: Function) -> Function:
        part = Part("target" if is_target else "plane", (show.__name__,))
        return PICTURE.add(parts or [part], content, high, is_there)(show)

    return added


def picture(state: WorldState, world: World, forecast: Forecast, choice: Choice = NOTHING_MORE) -> Tensor:
    """Return the state of the fire in 8 x 8 blocks of the map, float32 [B, A, C, 8, 8], the channels of ``PICTURE``."""
    return _shown(Blocks(state, world, forecast, PICTURE_SIDE, None, _known(state)), choice)


def centred_picture(
    state: WorldState, world: World, forecast: Forecast, choice: Choice = NOTHING_MORE, side: int = PICTURE_SIDE
) -> Tensor:
    """Return the picture with the agent's own block in the middle, uint8 [B, A, C, 15, 15]; 0 off the map.

    Args:
        state: The worlds.
        world: Their rules.
        forecast: What the fire is about to do.
        choice: What is shown beside what every picture shows.
        side: Blocks to a side of the map, of which those within seven blocks of the agent are shown.
    """
    block = block_of(state, side)
    about = window(torch.stack((block // side, block % side), dim=-1), (side, side), PICTURE_SIDE - 1)
    return _shown(Blocks(state, world, forecast, side, about, _known(state)), choice)


@picture_channel(is_there=everywhere, is_target=True)
def fire(now: Blocks) -> Tensor:
    """Return the square root of the share that burns."""
    burning = is_burning(now.state.cells) if now.known is None else now.known >= FIRST_FIRE
    return now.show(block_means(burning, now.side).sqrt_())


@picture_channel(is_there=everywhere)
def fuel(now: Blocks) -> Tensor:
    """Return the mean flammability of trees that can burn."""
    if now.known is None:
        return now.show(block_means(now.forecast.fuel, now.side))
    is_fuel = (now.known >= 1) & (now.known <= OLDEST)
    return now.show(block_means(now.state.alpha[:, None] * is_fuel, now.side))


@picture_channel(
    high=252,
    content=lambda world, names: Empty() if world.team.n_agents == 1 else None,
    is_there=everywhere,
)
def team_mates(now: Blocks) -> Tensor:
    """Return how many others there are, a quarter each, four at most."""
    if now.about is None or now.known is not None:
        return now.show(_mates(now).mul_(0.25).clamp_(max=1.0), 252)
    row, column = now.about.position.unbind(-1)
    block, middle = torch.add(column, row, alpha=now.side), now.about.radius
    counts = block.new_zeros(len(block), now.side**2).scatter_add_(1, block, torch.ones_like(block))
    mates = now.about.of(counts.view(-1, now.side, now.side))
    mates[..., middle, middle] -= 1
    return (mates.clamp_(max=4) * 63).to(torch.uint8)


@picture_channel(is_there=known_in_part)
def last_seen(now: Blocks) -> Tensor:
    """Return how fresh is what an agent knows, see ``records.freshness``."""
    return now.show(block_means(freshness(kept(now.state), now.state.step), now.side))


@picture_channel(
    parts=lambda world: [Part("plane", tuple(name for each in world.loop for name in each.picture_entries(world)))],
    is_there=lambda world, choice: any(each.picture_entries(world) for each in world.loop),
)
def mechanics(now: Blocks) -> Tensor:
    """Return the channels of the world's mechanics, see ``Mechanic.picture``."""
    parts = [each for each in now.world.loop if each.picture_entries(now.world)]
    shares = torch.cat([each.picture(now.state, now.side) for each in parts], dim=2)
    return torch.stack([now.show(each) for each in shares.unbind(2)], dim=2)


def _in_blocks(name: str, show: Map) -> Callable[[Blocks], Tensor]:
    """Return the channel that shows the square root of a map's means, given the name of its mechanic's planes."""

    def shown(now: Blocks) -> Tensor:
        if name not in now.state.extras.held:
            return now.show(torch.zeros_like(block_means(now.state.alpha, now.side)))
        return now.show(block_means(show(now.state).to(torch.float32), now.side).div_(255.0).sqrt_())

    return shown


add_maps(PICTURE, _in_blocks)


def _known(state: WorldState) -> Tensor | None:
    return None if records_of(state) is None else known_codes(state)


def _shown(now: Blocks, choice: Choice) -> Tensor:
    shown = [each.show(now) for each in PICTURE.shown(now.world, choice)]
    return torch.cat([each if each.ndim == 5 else each[:, :, None] for each in shown], dim=2)


def _mates(now: Blocks) -> Tensor:
    """Return how many others each agent takes to be in each block of the map, float32 [B, A, S, S]."""
    known, place = now.world.sensing.knows_where(now.state, now.world.team, now.world.hearing)
    team = now.state.vehicles.position.shape[:2]
    index = block_at(place, now.state, now.side).expand(*team, -1)
    count = torch.zeros(*team, now.side**2, device=index.device)
    count = count.scatter_add(2, index, known.to(torch.float32).expand_as(index))
    return count.unflatten(-1, (now.side, now.side))
