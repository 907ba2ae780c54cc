"""The whole map in blocks: what a dispatcher would radio."""

import torch
from torch import Tensor

from warp_torchrl.entries import Content, Empty, Planes, Target
from warp_torchrl.env.observation.blocks import block_at, block_of
from warp_torchrl.env.observation.channels import LAST_SEEN, OWN_LAND
from warp_torchrl.world.arrays.blocks import block_means
from warp_torchrl.world.arrays.squares import window
from warp_torchrl.world.mechanics.agencies.agencies import land_of_each
from warp_torchrl.world.mechanics.sensing.records import freshness, known_codes
from warp_torchrl.world.state.state import FIRST_FIRE, OLDEST, Forecast, WorldState, is_burning
from warp_torchrl.world.world import World

PICTURE = ("fire", "fuel", "team_mates")
"""Channels of ``picture``."""
PICTURE_SIDE = 8


def picture_names(world: World) -> tuple[str, ...]:
    """Return the channels of the picture.

    They are ``PICTURE``, where sight is limited ``last_seen``, how fresh they are, and where there are several agencies
    ``own_land``, the share of each block that is of the agency that the vehicle serves.
    """
    seen = (LAST_SEEN,) if world.sensing.is_limited else ()
    return (*PICTURE, *seen, *((OWN_LAND,) if world.agencies.names else ()))


def picture_highs(world: World) -> tuple[float, ...]:
    """Return the largest number in each channel of the picture, where it is centred."""
    return tuple(255 if name != "team_mates" else 252 for name in picture_names(world))


def picture_symmetry(centred: bool, channels: int = len(PICTURE), order: int = 1) -> Planes:
    """Return how the picture turns with the map; agents turn towards its fire where nothing of a lower order shows one.

    Args:
        centred: Whether the agent is in the middle.
        channels: How many there are.
        order: Of its fire among what shows fire; that of the view is 0.
    """
    fire = Target(PICTURE.index("fire"), order=order, near=0.5, is_share=True, in_middle=centred)
    return Planes(channels, fire)


def picture_content(world: World) -> tuple[Content, ...]:
    """Return what each channel of the picture can hold."""
    alone = {"team_mates": Empty()} if world.team.n_agents == 1 else {}
    return tuple(alone.get(name) for name in picture_names(world))


def picture(state: WorldState, world: World, forecast: Forecast) -> Tensor:
    """Return the state of the fire in 8 x 8 blocks of the map, float32 [B, A, C, 8, 8], see ``picture_names``."""
    mates = _mates(state, world).mul_(0.25).clamp_(max=1.0)[:, :, None]
    seen = _maps(state, forecast).expand(-1, mates.shape[1], -1, -1, -1)
    land = [each[:, :, None] for each in _land_served(state)]
    return torch.cat((seen[:, :, :2], mates, seen[:, :, 2:], *land), dim=2)


def centred_picture(state: WorldState, world: World, forecast: Forecast, side: int = PICTURE_SIDE) -> Tensor:
    """Return the picture with the agent's own block in the middle, uint8 [B, A, C, 15, 15]; 0 off the map.

    What it tells is what ``picture`` does; where things are is told from where the agent is.

    Args:
        state: The worlds.
        world: Their rules.
        forecast: What the fire is about to do.
        side: Blocks to a side of the map, of which those within seven blocks of the agent are shown.
    """
    sides, middle = (side, side), PICTURE_SIDE - 1
    maps = (_maps(state, forecast, side) * 255.0).to(torch.uint8).unbind(2)
    block = block_of(state, side)
    about = window(torch.stack((block // side, block % side), dim=-1), sides, middle)
    land = [about.of_own((each * 255.0).to(torch.uint8)) for each in _land_served(state, side)]
    if state.knowledge is None:
        fire, fuel = (about.of(each[:, 0]) for each in maps)
        counts = block.new_zeros(len(block), side**2).scatter_add_(1, block, torch.ones_like(block))
        mates = about.of(counts.view(-1, *sides))
        mates[..., middle, middle] -= 1
        return torch.stack((fire, fuel, (mates.clamp_(max=4) * 63).to(torch.uint8), *land), dim=2)
    fire, fuel, fresh = (about.of_own(each) for each in maps)
    mates = about.of_own(_mates(state, world, side).clamp_(max=4.0).mul_(63.0).to(torch.uint8))
    return torch.stack((fire, fuel, mates, fresh, *land), dim=2)


def _maps(state: WorldState, forecast: Forecast, side: int = PICTURE_SIDE) -> Tensor:
    """Return fire (square root of the share that burns) and fuel in S x S blocks, float32 [B, 1, 2, S, S].

    Where sight is limited they are what each agent knows, with how fresh that is, float32 [B, A, 3, S, S].
    """
    if state.knowledge is None:
        maps = [is_burning(state.cells)[:, None], forecast.fuel[:, None]]
    else:
        codes = known_codes(state)
        fuel = state.alpha[:, None] * ((codes >= 1) & (codes <= OLDEST))
        maps = [codes >= FIRST_FIRE, fuel, freshness(state.knowledge, state.step)]
    fire, *others = (block_means(each, side) for each in maps)
    return torch.stack((fire.sqrt_(), *others), dim=2)


def _land_served(state: WorldState, side: int = PICTURE_SIDE) -> list[Tensor]:
    """Return the share of each block that is of the agency that each vehicle serves, float32 [B, A, S, S].

    Nothing where there is but one agency.
    """
    if state.lands is None or state.vehicles.serves is None:
        return []
    shares, serves = block_means(land_of_each(state.lands), side), state.vehicles.serves
    index = serves[..., None, None].expand(-1, -1, side, side)
    return [shares.gather(1, index)]


def _mates(state: WorldState, world: World, side: int = PICTURE_SIDE) -> Tensor:
    """Return how many others each agent takes to be in each block of the map, float32 [B, A, S, S]."""
    known, place = world.sensing.knows_where(state, world.team)
    team = state.vehicles.position.shape[:2]
    index = block_at(place, state, side).expand(*team, -1)
    count = torch.zeros(*team, side**2, device=index.device)
    count = count.scatter_add(2, index, known.to(torch.float32).expand_as(index))
    return count.unflatten(-1, (side, side))
