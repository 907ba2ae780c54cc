"""What the agents see, and what the central critic sees.

A preset is a component: its ``spaces`` tell the environment the shape, type and range of each entry, and called with a
state it returns them.
"""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import adaptive_avg_pool2d, one_hot, pad

from warp_torchrl.validation import check_fields
from warp_torchrl.world.flags import byte, equal, number
from warp_torchrl.world.state import FIRST_FIRE, Action, WorldState, is_burning, is_tree
from warp_torchrl.world.team import ROLE_NAMES
from warp_torchrl.world.world import World

CHANNELS = (
    "off_map",
    "flammability",
    "age",
    "fire_stage",
    "ash",
    "firebreak",
    "wet",
    "relative_elevation",
    "threat",
    "other_ugv",
    "other_uav",
)
"""Channels of ``view``."""
SELF_SIZE = 9 + len(ROLE_NAMES) + len(Action)
"""Entries of ``self``: row, column, time left, wind east and north, steps to the tick, tank, whether it has a tank,
whether it may refill here, role (one-hot), last action (one-hot, zeros before the first)."""
PICTURE = ("fire", "fuel", "team_mates")
"""Channels of ``picture``."""
STATE = ("fire", "fuel", "ugv", "uav", "elevation", "time_left", "steps_to_tick", "wind_east", "wind_north")
"""Channels of the critic's ``state``."""
STATE_SIDE = 16
PICTURE_SIDE = 8
WIND_SCALE = 20.0
"""Wind that an observation shows as 1 [m/s]."""
ELEVATION_SCALE = 100.0
"""Difference in height that an observation shows as 1 [m]."""


class Space(NamedTuple):
    """Shape (one agent's), type and range of an entry of an observation."""

    shape: tuple[int, ...]
    dtype: torch.dtype
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Local:
    """What an agent sees of its own surroundings, and nothing else.

    ``view`` is the square of 2 r + 1 cells about the agent, north up, in the channels ``CHANNELS``, uint8: fractions
    times 255, elevation relative to the agent's cell as 128 + 127 dz / 100 m, other agents 63 each. ``self`` is what
    it knows of itself, see ``SELF_SIZE``.

    Attributes:
        radius: r [cells].

    Raises:
        ValueError: If the radius is not in 1..32.
    """

    radius: int = 5

    def __post_init__(self) -> None:
        check_fields(self, radius=(1, 32))

    def spaces(self, world: World) -> dict[str, Space]:
        """Return the space of each entry."""
        side = 2 * self.radius + 1
        return {
            "view": Space((len(CHANNELS), side, side), torch.uint8, 0, 255),
            "self": Space((SELF_SIZE,), torch.float32, -3.0, 3.0),
        }

    def __call__(self, state: WorldState, world: World) -> dict[str, Tensor]:
        """Return ``view`` uint8 [B, A, C, V, V] and ``self`` float32 [B, A, F]."""
        return {"view": egocentric_view(state, world, self.radius), "self": own_vector(state, world)}


@dataclass(frozen=True, kw_only=True)
class Surroundings(Local):
    """An agent's own surroundings and the state of the fire, as the paper has it: the default.

    As ``Local``, and ``picture``: what a dispatcher would radio, the whole map's fire (square root of the share of
    each block that burns), fuel and team-mates in 8 x 8 blocks.
    """

    def spaces(self, world: World) -> dict[str, Space]:
        """Return the space of each entry."""
        shape = (len(PICTURE), PICTURE_SIDE, PICTURE_SIDE)
        return {**super().spaces(world), "picture": Space(shape, torch.float32, 0.0, 1.0)}

    def __call__(self, state: WorldState, world: World) -> dict[str, Tensor]:
        """Return ``view``, ``self``, and ``picture`` float32 [B, A, 3, 8, 8]."""
        return {**super().__call__(state, world), "picture": picture(state)}


@dataclass(frozen=True, kw_only=True)
class Paper:
    """The paper's view: terrain class, tree age and fire stage about the agent, flattened.

    Off the map the terrain class is 0 and the others too; covers are (code + 1) / 5, ages / 10, fire stages / 5.

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
        return {"": Space((3 * (2 * self.radius + 1) ** 2,), torch.float32, 0.0, 1.0)}

    def __call__(self, state: WorldState, world: World) -> dict[str, Tensor]:
        """Return one entry, float32 [B, A, 3 (2 r + 1)^2]."""
        cover = (state.landscape.cover + 1) * 51
        planes = torch.stack((cover, _age_plane(state), _stage_plane(state)), dim=1)
        crops = crop(planes, state.vehicles.position, self.radius)
        return {"": crops.flatten(2).to(torch.float32).mul_(1.0 / 255.0)}


Observation = Surroundings | Local | Paper
"""Any observation preset."""


def crop(planes: Tensor, position: Tensor, radius: int) -> Tensor:
    """Cut the square about each agent out of its world's maps; beyond the border it is 0.

    Args:
        planes: Any type, [B, C, H, W].
        position: int64 [B, A, 2] [cells].
        radius: r [cells].

    Returns:
        [B, A, C, V, V], V = 2 r + 1.
    """
    worlds, channels = planes.shape[:2]
    side = 2 * radius + 1
    padded = pad(planes, (radius, radius, radius, radius))
    height, width = padded.shape[2:]
    rows = padded.flatten().as_strided((padded.numel() - side + 1, side), (1, 1))
    device = planes.device
    plane = torch.arange(worlds * channels, device=device).view(worlds, 1, channels, 1) * height
    row = position[..., 0, None, None] + torch.arange(side, device=device)
    start = (plane + row) * width + position[..., 1, None, None]
    return rows.index_select(0, start.flatten()).view(*start.shape, side)


def egocentric_view(state: WorldState, world: World, radius: int) -> Tensor:
    """Return the agents' own views in the channels ``CHANNELS``, uint8 [B, A, C, V, V]."""
    cells, vehicles = state.cells, state.vehicles
    empty = equal(cells, 0)
    ugv, uav = _occupancy(state, world)
    planes = torch.stack(
        (
            torch.full_like(cells, 255),
            (state.alpha * 255.0).to(torch.uint8),
            _age_plane(state),
            _stage_plane(state),
            byte(state.burned & empty) * 255,
            byte(state.firebreak) * 255,
            state.wet.clamp(max=10) * 25,
            torch.full_like(cells, 128),
            (world.threat(state) * 255.0).to(torch.uint8),
            ugv,
            uav,
        ),
        dim=1,
    )
    view = crop(planes, vehicles.position, radius)
    view[:, :, 0].neg_().sub_(1)  # on the map 255 -> 0, beyond it 0 -> 255
    if state.landscape.elevation is not None:
        view[:, :, 7] = _relative_elevation(state, radius)
    role = world.team.table(cells.device).index
    others = view[:, :, -len(ROLE_NAMES) :, radius, radius]
    others -= one_hot(role, len(ROLE_NAMES)).to(torch.uint8) * 63
    return view


def _age_plane(state: WorldState) -> Tensor:
    return state.cells * byte(is_tree(state.cells)) * 25


def _stage_plane(state: WorldState) -> Tensor:
    return (state.cells - (FIRST_FIRE - 1)) * byte(is_burning(state.cells)) * 51


def _relative_elevation(state: WorldState, radius: int) -> Tensor:
    heights = crop(state.landscape.elevation[:, None], state.vehicles.position, radius)[:, :, 0]
    own = heights[:, :, radius, radius, None, None]
    return ((heights - own) / ELEVATION_SCALE).clamp_(-1.0, 1.0).mul_(127.0).add_(128.0).to(torch.uint8)


def _occupancy(state: WorldState, world: World) -> tuple[Tensor, Tensor]:
    """Return where the agents of each role are, 63 each, at most 4 to a cell, uint8 [B, H, W] each."""
    worlds, height, width = state.cells.shape
    position = state.vehicles.position
    role = world.team.table(position.device).index
    index = (role * height + position[..., 0]) * width + position[..., 1]
    count = torch.zeros(worlds, len(ROLE_NAMES) * height * width, dtype=torch.uint8, device=position.device)
    count.scatter_add_(1, index, torch.ones_like(index, dtype=torch.uint8))
    return (count.clamp_(max=4) * 63).view(worlds, len(ROLE_NAMES), height, width).unbind(1)


def own_vector(state: WorldState, world: World) -> Tensor:
    """Return what each agent knows of itself, float32 [B, A, F], see ``SELF_SIZE``."""
    height, width = state.cells.shape[1:]
    vehicles = state.vehicles
    row, column = vehicles.position.to(torch.float32).unbind(-1)
    shape = row.shape
    roles = one_hot(world.team.table(row.device).index, len(ROLE_NAMES)).expand(*shape, -1)
    last = one_hot(vehicles.last_action + 1, len(Action) + 1)[..., 1:]
    full = world.team.tank or 1
    wind = _own_wind(state)
    columns = [
        row / max(height - 1, 1),
        column / max(width - 1, 1),
        _time_left(state, world)[:, None].expand(shape),
        wind[..., 0],
        wind[..., 1],
        _steps_to_tick(state, world)[:, None].expand(shape),
        vehicles.tank.abs() / full,
        (vehicles.tank >= 0).to(torch.float32),
        (vehicles.position == vehicles.base[:, None]).all(-1).to(torch.float32),
    ]
    return torch.cat((torch.stack(columns, dim=-1), roles, last), dim=-1)


def _time_left(state: WorldState, world: World) -> Tensor:
    return 1.0 - state.step / world.horizon


def _steps_to_tick(state: WorldState, world: World) -> Tensor:
    return 1.0 - (state.step % world.steps_per_tick) / world.steps_per_tick


def _own_wind(state: WorldState) -> Tensor:
    """Return the wind at each agent's cell, scaled, float32 [B, A, 2]."""
    wind, position = state.wind, state.vehicles.position
    if wind.shape[2:] == (1, 1):
        own = wind[:, None, :, 0, 0].expand(-1, position.shape[1], -1)
    else:
        index = position[..., 0] * wind.shape[3] + position[..., 1]
        own = wind.flatten(2).gather(2, index[:, None].expand(-1, 2, -1)).transpose(1, 2)
    return (own / WIND_SCALE).clamp(-3.0, 3.0)


def block_means(maps: Tensor, side: int) -> Tensor:
    """Return the means of maps over side x side blocks, float32 [B, C, side, side], of maps float32 [B, C, H, W].

    Where the map divides into equal blocks they are sums of slices, which on CPUs is several times faster than pooling.
    """
    height, width = maps.shape[2:]
    if height % side or width % side:
        return adaptive_avg_pool2d(maps, side)
    rows = maps.unflatten(2, (side, height // side)).unbind(3)
    columns = _sum(rows).unflatten(3, (side, width // side)).unbind(4)
    return _sum(columns) * (side * side / (height * width))


def _sum(parts: tuple[Tensor, ...]) -> Tensor:
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total


def picture(state: WorldState) -> Tensor:
    """Return the state of the fire in 8 x 8 blocks of the map, float32 [B, A, 3, 8, 8]."""
    height, width = state.cells.shape[1:]
    position = state.vehicles.position
    shape = position.shape[:2]
    maps = torch.stack((number(is_burning(state.cells)), _fuel(state)), dim=1)
    pooled = block_means(maps, PICTURE_SIDE)
    pooled[:, 0].sqrt_()
    block = (position[..., 0] * PICTURE_SIDE // height) * PICTURE_SIDE + position[..., 1] * PICTURE_SIDE // width
    place = one_hot(block, PICTURE_SIDE**2).to(torch.float32)
    mates = ((place.sum(1, keepdim=True) - place) * 0.25).clamp_(max=1.0)
    mates = mates.view(*shape, 1, PICTURE_SIDE, PICTURE_SIDE)
    return torch.cat((pooled[:, None].expand(-1, shape[1], -1, -1, -1), mates), dim=2)


def central_state(state: WorldState, world: World) -> Tensor:
    """Return what the central critic sees, float32 [B, C, 16, 16] in the channels ``STATE``, for any map size."""
    height, width = state.cells.shape[1:]
    worlds = state.cells.shape[0]
    elevation = state.landscape.elevation
    maps = [number(is_burning(state.cells)), _fuel(state)]
    if elevation is not None:
        maps.append((elevation - elevation.mean((1, 2), keepdim=True)) / ELEVATION_SCALE)
    pooled = block_means(torch.stack(maps, dim=1), STATE_SIDE)
    position, role = state.vehicles.position, world.team.table(state.cells.device).index
    row, column = position[..., 0] * STATE_SIDE // height, position[..., 1] * STATE_SIDE // width
    index = (role * STATE_SIDE + row) * STATE_SIDE + column
    out = torch.zeros(worlds, len(STATE), STATE_SIDE, STATE_SIDE, device=pooled.device)
    out[:, :2] = pooled[:, :2]
    agents = out[:, 2:4].reshape(worlds, -1)
    out[:, 2:4] = agents.scatter_add(1, index, torch.ones_like(index, dtype=torch.float32)).view_as(out[:, 2:4])
    if elevation is not None:
        out[:, 4] = pooled[:, 2].clamp(-3.0, 3.0)
    wind = (state.wind.mean((2, 3)) / WIND_SCALE).clamp(-3.0, 3.0)
    constants = (_time_left(state, world), _steps_to_tick(state, world), wind[:, 0], wind[:, 1])
    out[:, 5:] = torch.stack(constants, dim=1)[..., None, None]
    return out


def _fuel(state: WorldState) -> Tensor:
    return state.alpha * number(is_tree(state.cells))
