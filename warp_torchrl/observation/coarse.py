"""The whole map in blocks: what a dispatcher would radio, and what the central critic sees."""

import torch
from torch import Tensor
from torch.nn.functional import one_hot

from warp_torchrl.content import Content, Empty, Quarters
from warp_torchrl.observation.channels import ELEVATION_SCALE
from warp_torchrl.observation.own import WIND_SCALE, steps_to_tick, time_left
from warp_torchrl.symmetry import Planes, Target, TeamPlanes
from warp_torchrl.world.fast.blocks import block_means
from warp_torchrl.world.fast.squares import window
from warp_torchrl.world.role import PAPER_ROLES
from warp_torchrl.world.state import Forecast, WorldState, is_burning
from warp_torchrl.world.team import Team
from warp_torchrl.world.world import World

PICTURE = ("fire", "fuel", "team_mates")
"""Channels of ``picture``."""
CENTRED_HIGHS = (255, 255, 252)
"""Largest number in each of them, where the picture is centred."""
PICTURE_SIDE = 8
STATE = ("fire", "fuel", "front", "threat", *PAPER_ROLES, "elevation", "clock_and_wind")
"""Channels of the critic's ``state``: ``front`` is what fire is expected to ignite in a tick, ``threat`` the chance of
trees to ignite, and the quarters of ``clock_and_wind`` are filled with the time left, the steps to the tick, and the
wind to the east and to the north."""
_FIRST_ROLE = STATE.index(PAPER_ROLES[0])
STATE_SIDE = 16
STATE_SYMMETRY = TeamPlanes(len(STATE), STATE.index("fire"), (_FIRST_ROLE, len(PAPER_ROLES)))
"""How the state turns with the map in teams of the paper's roles."""


def picture_symmetry(centred: bool) -> Planes:
    """Return how the picture turns with the map; agents turn towards its fire where their view shows none."""
    fire = Target(PICTURE.index("fire"), order=1, near=0.5, is_share=True, in_middle=centred)
    return Planes(len(PICTURE), fire)


def picture(state: WorldState, forecast: Forecast) -> Tensor:
    """Return the state of the fire in 8 x 8 blocks of the map, float32 [B, A, 3, 8, 8]."""
    seen, place = (
        _fire_and_fuel(state, forecast),
        one_hot(_block(state, PICTURE_SIDE), PICTURE_SIDE**2).to(torch.float32),
    )
    mates = ((place.sum(1, keepdim=True) - place) * 0.25).clamp_(max=1.0)
    mates = mates.view(*place.shape[:2], 1, PICTURE_SIDE, PICTURE_SIDE)
    return torch.cat((seen[:, None].expand(-1, place.shape[1], -1, -1, -1), mates), dim=2)


def centred_picture(state: WorldState, forecast: Forecast) -> Tensor:
    """Return the picture with the agent's own block in the middle, uint8 [B, A, 3, 15, 15]; 0 off the map.

    What it tells is what ``picture`` does; where things are is told from where the agent is.
    """
    sides, middle = (PICTURE_SIDE, PICTURE_SIDE), PICTURE_SIDE - 1
    fire, fuel = (_fire_and_fuel(state, forecast) * 255.0).to(torch.uint8).unbind(1)
    block = _block(state, PICTURE_SIDE)
    about = window(torch.stack((block // PICTURE_SIDE, block % PICTURE_SIDE), dim=-1), sides, middle)
    mates = about.of(one_hot(block, PICTURE_SIDE**2).sum(1).view(-1, *sides))
    mates[..., middle, middle] -= 1
    return torch.stack((about.of(fire), about.of(fuel), (mates.clamp_(max=4) * 63).to(torch.uint8)), dim=2)


def state_names(team: Team) -> tuple[str, ...]:
    """Return the channels of the critic's ``state``: ``STATE``, with the team's further roles beside the paper's."""
    return (*STATE[:_FIRST_ROLE], *team.role_names, *STATE[_FIRST_ROLE + len(PAPER_ROLES) :])


def state_symmetry(team: Team) -> TeamPlanes:
    """Return how the state turns with the map."""
    return TeamPlanes(len(state_names(team)), STATE.index("fire"), (_FIRST_ROLE, len(team.role_names)))


def picture_content(team: Team) -> tuple[Content, ...]:
    """Return what each channel of the picture can hold."""
    return (None, None, None if team.n_agents > 1 else Empty())


def state_content(world: World) -> tuple[Content, ...]:
    """Return what each channel of the critic's ``state`` can hold."""
    held: dict[str, Content] = {role: Empty() for role in world.team.role_names if role not in world.team.agent_roles}
    held |= {"elevation": Empty()} if world.is_flat else {}
    return (*(held.get(name) for name in state_names(world.team)[:-1]), Quarters())


def central_state(state: WorldState, world: World, forecast: Forecast) -> Tensor:
    """Return what the central critic sees, float32 [B, C, 16, 16], see ``state_names``, for any map size."""
    worlds, blocks = state.cells.shape[0], (STATE_SIDE, STATE_SIDE)
    maps = is_burning(state.cells), forecast.fuel, forecast.expected_ignitions, forecast.ignition_probability
    index = world.team.table(state.cells.device).index * STATE_SIDE**2 + _block(state, STATE_SIDE)
    agents = torch.zeros(worlds, len(world.team.role_names) * STATE_SIDE**2, device=state.cells.device)
    agents = agents.scatter_add(1, index, torch.ones_like(index, dtype=torch.float32)).view(worlds, -1, *blocks)
    wind = (state.wind.mean((2, 3)) / WIND_SCALE).clamp(-3.0, 3.0)
    constants = torch.stack((time_left(state, world), steps_to_tick(state, world), wind[:, 0], wind[:, 1]), dim=1)
    quarters = constants.view(worlds, 2, 1, 2, 1).expand(-1, -1, STATE_SIDE // 2, -1, STATE_SIDE // 2)
    return torch.stack(
        (
            *(block_means(each, STATE_SIDE) for each in maps),
            *agents.unbind(1),
            _elevation(state.landscape.elevation, agents[:, 0]),
            quarters.reshape(worlds, *blocks),
        ),
        dim=1,
    )


def _elevation(elevation: Tensor | None, blocks: Tensor) -> Tensor:
    """Return the elevation over the map's mean in blocks, float32, shape of the blocks; 0 on a flat map."""
    if elevation is None:
        return torch.zeros_like(blocks)
    relative = (elevation - elevation.mean((1, 2), keepdim=True)) / ELEVATION_SCALE
    return block_means(relative, STATE_SIDE).clamp(-3.0, 3.0)


def _fire_and_fuel(state: WorldState, forecast: Forecast) -> Tensor:
    """Return the whole map's fire (square root of the share that burns) and fuel in blocks, float32 [B, 2, 8, 8]."""
    fire, fuel = (block_means(maps, PICTURE_SIDE) for maps in (is_burning(state.cells), forecast.fuel))
    return torch.stack((fire.sqrt_(), fuel), dim=1)


def _block(state: WorldState, side: int) -> Tensor:
    """Return in which of side x side blocks of the map each agent is, int64 [B, A]."""
    height, width = state.cells.shape[1:]
    row, column = state.vehicles.position.unbind(-1)
    return (row * side // height) * side + column * side // width
