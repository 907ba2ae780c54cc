"""What the central critic sees, the whole map in blocks and the team: a table of planes by name.

A plane reads a ``Context``. A module of a user's own adds one, which ``observation.features`` chooses:

    @state_plane()
    def assets(now: Context) -> Tensor:
        return block_means(..., STATE_SIDE)
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.entries import Content, Empty, Part, Quarters, TeamPlanes
from warp_torchrl.env.observation.channels import ELEVATION_SCALE
from warp_torchrl.env.observation.features import (
    NOTHING_MORE,
    Choice,
    Context,
    Feature,
    Features,
    Function,
    Holds,
    IsThere,
    Map,
    add_maps,
    anything,
    content_of,
    everywhere,
    first_of,
    known_in_part,
    names_of,
)
from warp_torchrl.env.observation.status import WIND_SCALE, steps_to_tick, time_left
from warp_torchrl.world.arrays.blocks import block_means
from warp_torchrl.world.arrays.distances import FAR
from warp_torchrl.world.fires.reach import distance_from_fire
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.records import freshness, kept, known_codes
from warp_torchrl.world.state.state import FIRST_FIRE, Forecast, WorldState
from warp_torchrl.world.team.places import block_of
from warp_torchrl.world.team.presence import on_scene, those_there
from warp_torchrl.world.world import World

STATE_SIDE = 16
STATE = Features("plane of state")
"""All planes of the critic's ``state`` but the last, ``clock_and_wind``, by name and in order."""


def state_plane(
    parts: Callable[[World], Sequence[Part]] | Sequence[Part] = (),
    content: Holds = anything,
    is_there: IsThere | None = None,
) -> Callable[[Function], Function]:
    """Return what adds a function to the table, under the function's name.

    The function returns numbers in -3..256, float32 [B, 16, 16], or [B, n, 16, 16] of several planes, or a number of
    each world, [B], which fills the plane.

    Args:
        parts: What the planes are called; a function of the world where it says. By default one plane, which has the
            function's name.
        content: Returns what they can hold in a world; networks leave out what the rules of the world fix.
        is_there: Returns whether a world shows them; None where an observation chooses them by name.

    Raises:
        ValueError: If the table has another plane of that name.
    """

    def added(show: Function) -> Function:
        return STATE.add(parts or [Part("plane", (show.__name__,))], content, 255, is_there)(show)

    return added


@dataclass(frozen=True, eq=False)  # torch 2.11 hashes what a compiled function makes before its fields are there
class CriticState:
    """The ``state`` of worlds, in 16 x 16 blocks for any map size.

    Attributes:
        world: The rules of the worlds.
        choice: What it shows beside what every state shows.
    """

    world: World
    choice: Choice = NOTHING_MORE

    @property
    def features(self) -> list[Feature]:
        """Return its features: those of ``STATE`` that are there, and the clock and the wind."""
        return [*STATE.shown(self.world, self.choice), CLOCK_AND_WIND]

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of its planes."""
        return names_of(self.features, self.world)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return the shape of one world's: planes, blocks down and across."""
        return len(self.names), STATE_SIDE, STATE_SIDE

    @property
    def symmetry(self) -> TeamPlanes:
        """Return how it turns with the map."""
        target, agents = (first_of(kind, self.features, self.world) for kind in ("target", "agents"))
        if target is None or agents is None:
            raise ValueError("the critic's state must show what the team turns towards, and the team")
        return TeamPlanes(len(self.names), target[0], agents)

    @property
    def content(self) -> tuple[Content, ...]:
        """Return what each plane can hold."""
        return content_of(self.features, self.world)

    def __call__(self, state: WorldState, forecast: Forecast) -> Tensor:
        """Return it, float32 [B, C, 16, 16], see ``names``.

        Args:
            state: The worlds.
            forecast: What the fire is about to do.
        """
        now = Context(state, self.world, forecast, self.choice)
        return torch.cat([_as_planes(each.show(now)) for each in self.features], dim=1)


@state_plane([Part("target", ("fire",))], is_there=everywhere)
def fire(now: Context) -> Tensor:
    """Return the share that burns."""
    return block_means(is_burning(now.state.cells), STATE_SIDE)


@state_plane(is_there=everywhere)
def fuel(now: Context) -> Tensor:
    """Return the mean flammability of trees that can burn."""
    return block_means(now.forecast.fuel, STATE_SIDE)


@state_plane(is_there=everywhere)
def front(now: Context) -> Tensor:
    """Return what fire is expected to ignite in a tick."""
    return block_means(now.forecast.expected_ignitions, STATE_SIDE)


@state_plane(is_there=everywhere)
def threat(now: Context) -> Tensor:
    """Return the chance of trees to ignite."""
    return block_means(now.forecast.ignition_probability, STATE_SIDE)


def _of_roles(world: World, names: Sequence[str]) -> tuple[Content, ...]:
    team = world.team
    return tuple(None if role in team.agent_roles else Empty() for role in team.role_names)


@state_plane(lambda world: [Part("agents", world.team.role_names)], _of_roles, everywhere)
def vehicles(now: Context) -> Tensor:
    """Return how many vehicles of each role there are on the scene."""
    cells, team = now.state.cells, now.world.team
    worlds, roles = cells.shape[0], len(team.role_names)
    index = team.table(cells.device).index * STATE_SIDE**2 + block_of(now.state, STATE_SIDE)
    count = torch.zeros(worlds, roles * STATE_SIDE**2, device=cells.device)
    each = those_there(now.state, torch.ones_like(index, dtype=torch.bool))
    count = count.scatter_add(1, index, each.to(torch.float32))
    return count.view(worlds, roles, STATE_SIDE, STATE_SIDE)


@state_plane(content=lambda world, names: Empty() if world.is_flat else None, is_there=everywhere)
def elevation(now: Context) -> Tensor:
    """Return the elevation over the map's mean; 0 on a flat map."""
    heights = now.state.landscape.elevation
    if heights is None:
        return torch.zeros(len(now.state.cells), device=now.state.cells.device)
    relative = (heights - heights.mean((1, 2), keepdim=True)) / ELEVATION_SCALE
    return block_means(relative, STATE_SIDE).clamp(-3.0, 3.0)


@state_plane(is_there=known_in_part)
def known_fire(now: Context) -> Tensor:
    """Return the burning cells that agents know of, mean of the agents."""
    return block_means((known_codes(now.state) >= FIRST_FIRE).to(torch.float32).mean(dim=1), STATE_SIDE)


@state_plane(is_there=known_in_part)
def last_seen(now: Context) -> Tensor:
    """Return how fresh is what agents know, mean of the agents, see ``records.freshness``."""
    return block_means(freshness(kept(now.state), now.state.step).mean(dim=1), STATE_SIDE)


@state_plane(
    lambda world: [Part("plane", tuple(name for each in world.loop for name in each.critic_entries(world)))],
    is_there=lambda world, choice: any(each.critic_entries(world) for each in world.loop),
)
def mechanics(now: Context) -> Tensor:
    """Return the planes of the world's mechanics, see ``Mechanic.critic``."""
    parts = [each for each in now.world.loop if each.critic_entries(now.world)]
    return torch.cat([each.critic(now.state, STATE_SIDE) for each in parts], dim=1)


@state_plane([Part("plane", ("fire_reach", "team_reach"))], is_there=lambda world, choice: choice.reach)
def reach(now: Context) -> Tensor:
    """Return how soon fire, and how soon the team, can be where, see ``reach_of_fire_and_team``."""
    return torch.stack(reach_of_fire_and_team(now.state, now.world), dim=1)


def _in_state(name: str, show: Map) -> Callable[[Context], Tensor]:
    """Return the plane that shows a map's means, of all agents, given the name of its mechanic's planes."""

    def shown(now: Context) -> Tensor:
        if name not in now.state.extras.held:
            return torch.zeros_like(block_means(now.state.alpha, STATE_SIDE))
        means = block_means(show(now.state).to(torch.float32), STATE_SIDE) / 255.0
        return means.mean(dim=1) if means.ndim == 4 else means

    return shown


add_maps(STATE, _in_state, is_of_agents=False)


def clock_and_wind(now: Context) -> Tensor:
    """Return the time left, the steps to the tick, and the wind to east and north, each in a quarter of the plane."""
    state, half = now.state, STATE_SIDE // 2
    wind = (state.wind.mean((2, 3)) / WIND_SCALE).clamp(-3.0, 3.0)
    told = torch.stack((time_left(state, now.world), steps_to_tick(state, now.world), wind[:, 0], wind[:, 1]), dim=1)
    return told.view(-1, 2, 1, 2, 1).expand(-1, -1, half, -1, half).reshape(-1, STATE_SIDE, STATE_SIDE)


CLOCK_AND_WIND = Feature(
    clock_and_wind, lambda world: [Part("plane", ("clock_and_wind",))], lambda world, names: Quarters(), 255, everywhere
)
"""The last plane of every state, where networks find the wind to turn it."""


def _as_planes(shown: Tensor) -> Tensor:
    """Return what a function of the table returned as planes, float32 [B, n, 16, 16]."""
    if shown.ndim == 1:
        return shown[:, None, None, None].expand(-1, 1, STATE_SIDE, STATE_SIDE)
    return shown if shown.ndim == 4 else shown[:, None]


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
    ways = torch.maximum(down[..., :, None], across[..., None, :])
    there = on_scene(state)
    nearest = (ways if there is None else ways.masked_fill(~there[..., None, None], float(FAR))).amin(dim=1)
    return fire, torch.exp(nearest / (-2.0 * side))
