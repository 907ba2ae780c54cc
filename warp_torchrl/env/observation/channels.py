"""The channels of an agent's view: a table of functions by name, from which ``observation.channels`` chooses.

A channel reads a ``Look``, the squares of the map about the agents, and returns whole numbers 0..255. A module of a
user's own adds one:

    @channel(high=255)
    def assets(look: Look) -> Tensor:
        ...
"""

from collections.abc import Callable, Sequence

import torch
from torch import Tensor

from warp_torchrl.entries import Content, Empty, Follows, Part
from warp_torchrl.env.observation.features import Features, Function, Holds, Map, add_maps, anything
from warp_torchrl.env.observation.look import Look
from warp_torchrl.world.arrays.bytes import byte, to_codes
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.role import PAPER_ROLES
from warp_torchrl.world.state.state import FIRST_FIRE
from warp_torchrl.world.world import World

ELEVATION_SCALE = 100.0
"""Difference in height that an observation shows as 1 [m]."""
CHANNELS = Features("channel")
"""All channels, by name."""


def _of_ground(world: World, names: Sequence[str]) -> Content:
    """Return what heights show: on flat ground 128 on the map and 0 beyond, which ``off_map`` tells too."""
    if world.is_flat and "off_map" in names:
        return Follows(list(names).index("off_map"), -128.0 / 255.0, 128.0)
    return None


def others_of(role: str, world: World) -> Content:
    """Return what a plane of other agents of a role can hold: nothing where no agent has another of it."""
    roles = world.team.agent_roles
    return None if role in roles and len(roles) > 1 else Empty()


def channel(high: int = 255, content: Holds = anything, is_target: bool = False) -> Callable[[Function], Function]:
    """Return what adds a function to the table, under the function's name.

    Args:
        high: The largest number that it returns, at most 255.
        content: Returns what it can hold in a world, in a view of channels by name; networks leave out what the rules
            of the world fix. By default anything.
        is_target: Whether it shows what agents turn towards.

    Raises:
        ValueError: If the number is not in 1..255, or the table has another channel of that name.
    """

    def added(show: Function) -> Function:
        part = Part("target" if is_target else "plane", (show.__name__,))
        return CHANNELS.add([part], content, high, None)(show)

    return added


@channel()
def off_map(look: Look) -> Tensor:
    """Return 255 beyond the map."""
    return (look.on_map ^ 1) * 255


@channel()
def flammability(look: Look) -> Tensor:
    """Return alpha of the ground, 255 times."""
    return look.alpha


@channel(high=250)
def age(look: Look) -> Tensor:
    """Return the ages of trees, 25 a year of ten."""
    return ages(look.cells)


@channel(is_target=True)
def fire_stage(look: Look) -> Tensor:
    """Return the stages of fires, 51 each."""
    return stages(look.cells)


@channel()
def ash(look: Look) -> Tensor:
    """Return 255 where a tree has burned to ash and none stands."""
    return look.ash * 255


@channel()
def firebreak(look: Look) -> Tensor:
    """Return 255 where an agent has cleared."""
    return look.firebreak * 255


@channel(high=250)
def wet(look: Look) -> Tensor:
    """Return the ticks for which a tree cannot ignite, 25 each, ten at most."""
    return look.wet.clamp(max=10) * 25


@channel(content=_of_ground)
def relative_elevation(look: Look) -> Tensor:
    """Return the height over the agent's own cell, 128 + 127 dz / 100 m."""
    elevation = look.state.landscape.elevation
    if elevation is None:
        return look.on_map * 128
    heights = look.window.of(elevation)
    middle = heights.shape[-1] // 2
    own = heights[:, :, middle, middle, None, None]
    return to_codes(((heights - own) / ELEVATION_SCALE).clamp_(-1.0, 1.0).mul_(127.0).add_(128.0))


@channel(content=lambda world, names: Empty() if world.sensing.is_limited else None)
def threat(look: Look) -> Tensor:
    """Return where the fire is about to grow, 255 times: a tree's chance to ignite, a fire's expected ignitions."""
    return look.fire_risk


@channel(high=252, content=lambda world, names: others_of("ugv", world))
def other_ugv(look: Look) -> Tensor:
    """Return where other ground vehicles are, 63 each, four at most."""
    return look.others[:, :, PAPER_ROLES.index("ugv")]


@channel(high=252, content=lambda world, names: others_of("uav", world))
def other_uav(look: Look) -> Tensor:
    """Return where other aircraft are, 63 each, four at most."""
    return look.others[:, :, PAPER_ROLES.index("uav")]


DEFAULT = tuple(CHANNELS)
"""The channels of a view unless others are chosen."""


@channel()
def last_seen(look: Look) -> Tensor:
    """Return how long ago cells were seen, 255 now, 128 sixteen steps ago, 0 never, see ``records.freshness``."""
    return look.on_map * 255 if look.fresh is None else look.fresh


@channel(high=252, content=lambda world, names: others_of("scout", world))
def other_scout(look: Look) -> Tensor:
    """Return where other scouts are, 63 each, four at most."""
    roles = look.world.team.role_names
    return look.others[:, :, roles.index("scout")] if "scout" in roles else torch.zeros_like(look.others[:, :, 0])


def _in_view(name: str, show: Map) -> Callable[[Look], Tensor]:
    """Return the channel that shows a map of a mechanic, given the name of its planes."""

    def shown(look: Look) -> Tensor:
        if name not in look.state.extras.held:
            return torch.zeros_like(look.on_map)
        codes = show(look.state)
        return look.window.of_own(codes) if codes.ndim == 4 else look.window.of(codes)

    return shown


add_maps(CHANNELS, _in_view)


def check_channels(names: Sequence[str]) -> None:
    """Check a choice of channels.

    Raises:
        ValueError: If there is none, one is not in the table, or one is named twice.
    """
    unknown = [name for name in names if name not in CHANNELS]
    if not names or unknown or len(set(names)) < len(names):
        got = unknown[0] if unknown else list(names)
        raise ValueError(f"channels must be a list of different names of {', '.join(CHANNELS)}, got {got}")


def ages(cells: Tensor) -> Tensor:
    """Return the ages of trees, 25 a year of ten, shape of the cells."""
    return cells * byte(is_tree(cells)) * 25


def stages(cells: Tensor) -> Tensor:
    """Return the stages of fires, 51 each, shape of the cells."""
    return (cells - (FIRST_FIRE - 1)) * byte(is_burning(cells)) * 51
