"""What the central critic sees: the whole map in blocks, and the team."""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import one_hot

from warp_torchrl.entries import Content, Empty, Quarters, TeamPlanes
from warp_torchrl.env.observation.blocks import block_of
from warp_torchrl.env.observation.channels import ELEVATION_SCALE, LAST_SEEN
from warp_torchrl.env.observation.status import WIND_SCALE, steps_to_tick, time_left
from warp_torchrl.world.arrays.blocks import block_means
from warp_torchrl.world.fires.reach import distance_from_fire
from warp_torchrl.world.mechanics.agencies.agencies import land_of_each
from warp_torchrl.world.mechanics.sensing.records import freshness, known_codes
from warp_torchrl.world.state.role import PAPER_ROLES
from warp_torchrl.world.state.state import FIRST_FIRE, Forecast, WorldState, is_burning
from warp_torchrl.world.world import World

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


@dataclass(frozen=True, eq=False)  # torch 2.11 hashes what a compiled function makes before its fields are there
class CriticState:
    """The ``state`` of worlds, in 16 x 16 blocks for any map size.

    Attributes:
        world: The rules of the worlds.
        reach: Whether it tells how soon fire and team can be where, see ``reach_of_fire_and_team``.
    """

    world: World
    reach: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Return the channels: ``STATE``, with the team's further roles beside the paper's.

        Where sight is limited there are ``KNOWN`` too: the burning cells that agents know of, and how fresh what they
        know is, both the mean of the agents. Where there are several agencies there is the land of each, and the
        vehicles that serve it. With ``reach`` there are ``REACH``.
        """
        known = KNOWN if self.world.sensing.is_limited else ()
        land = [f"{what}_of_{name}" for what in ("land", "vehicles") for name in self.world.agencies.names]
        return (
            *STATE[:_FIRST_ROLE],
            *self.world.team.role_names,
            *STATE[_FIRST_ROLE + len(PAPER_ROLES) : -1],
            *known,
            *land,
            *(REACH if self.reach else ()),
            STATE[-1],
        )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return the shape of one world's: channels, blocks down and across."""
        return len(self.names), STATE_SIDE, STATE_SIDE

    @property
    def symmetry(self) -> TeamPlanes:
        """Return how it turns with the map."""
        return TeamPlanes(len(self.names), STATE.index("fire"), (_FIRST_ROLE, len(self.world.team.role_names)))

    @property
    def content(self) -> tuple[Content, ...]:
        """Return what each channel can hold."""
        team = self.world.team
        held: dict[str, Content] = {role: Empty() for role in team.role_names if role not in team.agent_roles}
        held |= {"elevation": Empty()} if self.world.is_flat else {}
        return (*(held.get(name) for name in self.names[:-1]), Quarters())

    def __call__(self, state: WorldState, forecast: Forecast) -> Tensor:
        """Return it, float32 [B, C, 16, 16], see ``names``.

        Args:
            state: The worlds.
            forecast: What the fire is about to do.
        """
        maps = is_burning(state.cells), forecast.fuel, forecast.expected_ignitions, forecast.ignition_probability
        agents = _vehicles(state, self.world)
        return torch.stack(
            (
                *(block_means(each, STATE_SIDE) for each in maps),
                *agents.unbind(1),
                _elevation(state.landscape.elevation, agents[:, 0]),
                *_known(state),
                *_lands(state),
                *(reach_of_fire_and_team(state, self.world) if self.reach else ()),
                _clock_and_wind(state, self.world),
            ),
            dim=1,
        )


def reach_of_fire_and_team(state: WorldState, world: World) -> tuple[Tensor, Tensor]:
    """Return how soon fire, and how soon the team, can be where, float32 [B, 16, 16] each, in 0..1.

    With m moves to go it is e^(-m / 2b), b the block's side: for fire the mean over the block, m its way to each tree
    (``distance_from_fire``), and nothing where it cannot go, as behind a closed firebreak; for the team m from the
    nearest vehicle to the middle of the block.
    """
    height, width = state.cells.shape[1:]
    side = max(height, width) / STATE_SIDE
    away = distance_from_fire(state, world)
    fire = block_means((away > 0) * torch.exp(away / (-2.0 * side)), STATE_SIDE)
    middle = torch.arange(STATE_SIDE, device=away.device) + 0.5
    row, column = (state.vehicles.position + 0.5).unbind(-1)
    down = (middle * (height / STATE_SIDE) - row[..., None]).abs()
    across = (middle * (width / STATE_SIDE) - column[..., None]).abs()
    nearest = torch.maximum(down[..., :, None], across[..., None, :]).amin(dim=1)
    return fire, torch.exp(nearest / (-2.0 * side))


def _vehicles(state: WorldState, world: World) -> Tensor:
    """Return how many vehicles of each role are in each block, float32 [B, roles, 16, 16]."""
    worlds, roles = state.cells.shape[0], len(world.team.role_names)
    index = world.team.table(state.cells.device).index * STATE_SIDE**2 + block_of(state, STATE_SIDE)
    count = torch.zeros(worlds, roles * STATE_SIDE**2, device=state.cells.device)
    count = count.scatter_add(1, index, torch.ones_like(index, dtype=torch.float32))
    return count.view(worlds, roles, STATE_SIDE, STATE_SIDE)


def _clock_and_wind(state: WorldState, world: World) -> Tensor:
    """Return the time left, the steps to the tick and the wind, each in a quarter of the map, float32 [B, 16, 16]."""
    wind = (state.wind.mean((2, 3)) / WIND_SCALE).clamp(-3.0, 3.0)
    told = torch.stack((time_left(state, world), steps_to_tick(state, world), wind[:, 0], wind[:, 1]), dim=1)
    half = STATE_SIDE // 2
    return told.view(-1, 2, 1, 2, 1).expand(-1, -1, half, -1, half).reshape(-1, STATE_SIDE, STATE_SIDE)


def _elevation(elevation: Tensor | None, blocks: Tensor) -> Tensor:
    """Return the elevation over the map's mean in blocks, float32, shape of the blocks; 0 on a flat map."""
    if elevation is None:
        return torch.zeros_like(blocks)
    relative = (elevation - elevation.mean((1, 2), keepdim=True)) / ELEVATION_SCALE
    return block_means(relative, STATE_SIDE).clamp(-3.0, 3.0)


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
    place = one_hot(block_of(state, STATE_SIDE), STATE_SIDE**2).to(torch.float32)
    agencies = torch.arange(land.shape[1], device=land.device)[:, None]
    serving = (state.vehicles.serves[:, None] == agencies).to(torch.float32) @ place
    return [*block_means(land, STATE_SIDE).unbind(1), *serving.unflatten(-1, (STATE_SIDE, STATE_SIDE)).unbind(1)]
