"""The whole map in blocks: what a dispatcher would radio, and what the central critic sees."""

import torch
from torch import Tensor
from torch.nn.functional import one_hot

from warp_torchrl.content import Content, Empty, Quarters
from warp_torchrl.observation.channels import ELEVATION_SCALE, LAST_SEEN, OWN_LAND
from warp_torchrl.observation.own import WIND_SCALE, steps_to_tick, time_left
from warp_torchrl.symmetry import Planes, Target, TeamPlanes
from warp_torchrl.world.agencies import land_of_each
from warp_torchrl.world.fast.blocks import block_means
from warp_torchrl.world.fast.squares import window
from warp_torchrl.world.reach import way_of_fire
from warp_torchrl.world.records import freshness, known_codes
from warp_torchrl.world.role import PAPER_ROLES
from warp_torchrl.world.state import FIRST_FIRE, OLDEST, Forecast, WorldState, is_burning
from warp_torchrl.world.world import World

PICTURE = ("fire", "fuel", "team_mates")
"""Channels of ``picture``."""
PICTURE_SIDE = 8
STATE = ("fire", "fuel", "front", "threat", *PAPER_ROLES, "elevation", "clock_and_wind")
"""Channels of the critic's ``state``: ``front`` is what fire is expected to ignite in a tick, ``threat`` the chance of
trees to ignite, and the quarters of ``clock_and_wind`` are filled with the time left, the steps to the tick, and the
wind to the east and to the north."""
_FIRST_ROLE = STATE.index(PAPER_ROLES[0])
KNOWN = ("known_fire", LAST_SEEN)
"""Channels of the critic's ``state`` where sight is limited."""
REACH = ("fire_reach", "team_reach")
"""Channels of the critic's ``state`` where ``observation.reach`` asks for them."""
STATE_SIDE = 16
STATE_SYMMETRY = TeamPlanes(len(STATE), STATE.index("fire"), (_FIRST_ROLE, len(PAPER_ROLES)))
"""How the state turns with the map in teams of the paper's roles."""


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
    block = _block(state, side)
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


def state_names(world: World, reach: bool = False) -> tuple[str, ...]:
    """Return the channels of the critic's ``state``: ``STATE``, with the team's further roles beside the paper's.

    Where sight is limited it has ``KNOWN`` too: the burning cells that agents know of, and how fresh what they know is,
    both the mean of the agents. Where there are several agencies it has the land of each, and the vehicles that serve
    it. With ``reach`` it has ``REACH``, see ``reach_of_fire_and_team``.
    """
    known = KNOWN if world.sensing.is_limited else ()
    land = [f"{what}_of_{name}" for what in ("land", "vehicles") for name in world.agencies.names]
    return (
        *STATE[:_FIRST_ROLE],
        *world.team.role_names,
        *STATE[_FIRST_ROLE + len(PAPER_ROLES) : -1],
        *known,
        *land,
        *(REACH if reach else ()),
        STATE[-1],
    )


def state_symmetry(world: World, reach: bool = False) -> TeamPlanes:
    """Return how the state turns with the map."""
    return TeamPlanes(len(state_names(world, reach)), STATE.index("fire"), (_FIRST_ROLE, len(world.team.role_names)))


def picture_content(world: World) -> tuple[Content, ...]:
    """Return what each channel of the picture can hold."""
    alone = {"team_mates": Empty()} if world.team.n_agents == 1 else {}
    return tuple(alone.get(name) for name in picture_names(world))


def state_content(world: World, reach: bool = False) -> tuple[Content, ...]:
    """Return what each channel of the critic's ``state`` can hold."""
    held: dict[str, Content] = {role: Empty() for role in world.team.role_names if role not in world.team.agent_roles}
    held |= {"elevation": Empty()} if world.is_flat else {}
    return (*(held.get(name) for name in state_names(world, reach)[:-1]), Quarters())


def central_state(state: WorldState, world: World, forecast: Forecast, reach: bool = False) -> Tensor:
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
            *_known(state),
            *_lands(state),
            *(reach_of_fire_and_team(state, world) if reach else ()),
            quarters.reshape(worlds, *blocks),
        ),
        dim=1,
    )


def reach_of_fire_and_team(state: WorldState, world: World) -> tuple[Tensor, Tensor]:
    """Return how soon fire, and how soon the team, can be where, float32 [B, 16, 16] each, in 0..1.

    With m moves to go it is e^(-m / 2b), b the block's side: for fire the mean over the block, m its way to each tree
    (``way_of_fire``), and nothing where it cannot go, as behind a closed firebreak; for the team m from the nearest
    vehicle to the middle of the block.
    """
    height, width = state.cells.shape[1:]
    side = max(height, width) / STATE_SIDE
    away = way_of_fire(state, world)
    fire = block_means((away > 0) * torch.exp(away / (-2.0 * side)), STATE_SIDE)
    middle = torch.arange(STATE_SIDE, device=away.device) + 0.5
    row, column = (state.vehicles.position + 0.5).unbind(-1)
    down = (middle * (height / STATE_SIDE) - row[..., None]).abs()
    across = (middle * (width / STATE_SIDE) - column[..., None]).abs()
    nearest = torch.maximum(down[..., :, None], across[..., None, :]).amin(dim=1)
    return fire, torch.exp(nearest / (-2.0 * side))


def _elevation(elevation: Tensor | None, blocks: Tensor) -> Tensor:
    """Return the elevation over the map's mean in blocks, float32, shape of the blocks; 0 on a flat map."""
    if elevation is None:
        return torch.zeros_like(blocks)
    relative = (elevation - elevation.mean((1, 2), keepdim=True)) / ELEVATION_SCALE
    return block_means(relative, STATE_SIDE).clamp(-3.0, 3.0)


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


def _known(state: WorldState) -> list[Tensor]:
    """Return ``KNOWN`` in blocks, float32 [B, 16, 16] each; nothing where all is seen."""
    if state.knowledge is None:
        return []
    maps = (known_codes(state) >= FIRST_FIRE).to(torch.float32), freshness(state.knowledge, state.step)
    return [block_means(each.mean(dim=1), STATE_SIDE) for each in maps]


def _lands(state: WorldState) -> list[Tensor]:
    """Return the land of each agency, then the vehicles that serve it, float32 [B, 16, 16] each."""
    if state.lands is None or state.vehicles.serves is None:
        return []
    land = land_of_each(state.lands)
    place = one_hot(_block(state, STATE_SIDE), STATE_SIDE**2).to(torch.float32)
    agencies = torch.arange(land.shape[1], device=land.device)[:, None]
    serving = (state.vehicles.serves[:, None] == agencies).to(torch.float32) @ place
    return [*block_means(land, STATE_SIDE).unbind(1), *serving.unflatten(-1, (STATE_SIDE, STATE_SIDE)).unbind(1)]


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
    index = _block_at(place, state, side).expand(*team, -1)
    count = torch.zeros(*team, side**2, device=index.device)
    count = count.scatter_add(2, index, known.to(torch.float32).expand_as(index))
    return count.unflatten(-1, (side, side))


def _block(state: WorldState, side: int) -> Tensor:
    """Return in which of side x side blocks of the map each agent is, int64 [B, A]."""
    return _block_at(state.vehicles.position, state, side)


def _block_at(place: Tensor, state: WorldState, side: int) -> Tensor:
    """Return in which of side x side blocks of the map cells are, int64 [...], of (row, column) int64 [..., 2]."""
    height, width = state.cells.shape[1:]
    row, column = place.unbind(-1)
    return (row * side // height) * side + column * side // width
