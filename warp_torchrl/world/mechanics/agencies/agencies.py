"""Agencies: whose land is whose, whom each vehicle serves, and how vehicles are lent.

The map is parted among agencies. Each has land and vehicles of its own, and there may be a pool of vehicles that serve
whoever needs them.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from torch import Tensor
from torch.nn.functional import one_hot

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.arrays.blocks import block_means
from warp_torchrl.world.arrays.random import Stream, uniform
from warp_torchrl.world.mechanics.groups import Agencies
from warp_torchrl.world.mechanics.mechanic import Metric, Rules
from warp_torchrl.world.mechanics.table import part
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.state import Cover, WorldState
from warp_torchrl.world.state.worth import sums_by, worth_of
from warp_torchrl.world.team.places import block_of
from warp_torchrl.world.team.start import distances_to, first_free
from warp_torchrl.world.team.team import Team

_HOME = 0.35
"""How far an agency's home is from the middle of the map, as a share of its shorter side."""


@dataclass(eq=False, repr=False)
class Lands(Batch):
    """Whose land is whose, and whom vehicles serve."""

    owner: Tensor  # uint8 [B,H,W], index of an agency
    worth: Tensor  # float32 [B,K], of the initial trees of each agency's land, in the unit of ``Landscape.assets`` or 1
    serves: Tensor  # int64 [B,A], the agency that each vehicle serves now


@part
@dataclass(frozen=True, kw_only=True)
class SeveralAgencies(Agencies):
    """Agencies with land and vehicles of their own, and a pool of vehicles that serve one of them at a time.

    The land is parted into sectors about the middle of the map, all of one angle, in a direction drawn for each
    episode. The first ``own`` vehicles are the first agency's, the next ``own`` the second's, and so on; those that
    remain are the pool's. A vehicle starts near the home of the agency that it serves, on its land, unless
    ``team.start`` is ``anywhere``. Tanks and batteries fill up at the one base of all.

    Attributes:
        count: K, agencies.
        own: Vehicles of each agency; None parts the whole team equally, and what is left over is the pool's.
        lending: ``fixed``, vehicles of the pool serve the agencies in turn, each the same one for ever; ``need``, they
            are lent anew every ``term`` steps in proportion to the worth of the trees that burn on each agency's land,
            by the method of D'Hondt. Where nothing burns they stay with whom they serve.
        term: For how long vehicles are lent [steps].

    Raises:
        ValueError: If a value is out of its range.
    """

    count: int = 2
    own: int | None = None
    lending: Literal["fixed", "need"] = "fixed"
    term: int = 16

    baselines: ClassVar[tuple[str, ...]] = ("own_land",)
    maps: ClassVar = {"own_land": lambda state: own_land(state).to(torch.uint8) * 255}

    def __post_init__(self) -> None:
        check_fields(self, count=(2, 16), own=(0, 256), term=(1, 1_000_000))

    @property
    def names(self) -> tuple[str, ...]:
        """Return ``agency_0`` and so on."""
        return tuple(f"agency_{index}" for index in range(self.count))

    def check(self, world: Rules) -> None:
        """Check that the team has vehicles enough.

        Raises:
            ValueError: If not.
        """
        least = self.count * (1 if self.own is None else self.own)
        if world.team.n_agents < least:
            raise ValueError(
                f"team.n_agents must be at least {least}, the vehicles that {self.count} agencies own, "
                f"got {world.team.n_agents}"
            )

    def groups(self, team: Team) -> dict[str, list[int]]:
        """Return the vehicles of each agency and of the ``pool`` by their index; no group is empty."""
        own, places = self._owned(team.n_agents), list(range(team.n_agents))
        parts = {name: places[index * own : (index + 1) * own] for index, name in enumerate(self.names)}
        return {name: part for name, part in {**parts, "pool": places[self.count * own :]}.items() if part}

    def begin(self, state: WorldState, world: Rules) -> WorldState:
        """Return worlds at the start of an episode with their lands, and the vehicles where they start."""
        team = world.team
        owner, homes = self._parted(state)
        worth = sums_by(owner, worth_of(state) * state.initial, self.count)
        own, places = self._owned(team.n_agents), torch.arange(team.n_agents, device=owner.device)
        serves = torch.where(places < self.count * own, places // max(own, 1), (places - self.count * own) % self.count)
        if team.start == "corner":
            starts = self._starts(state, owner, homes, serves)
            state = state.replace(vehicles=state.vehicles.replace(position=starts))
        serves = serves.expand(len(owner), -1).clone()
        return state.with_planes(self.name, Lands(owner=owner, worth=worth, serves=serves))

    def step(self, before: WorldState, after: WorldState, running: Tensor, world: Rules) -> WorldState:
        """Return worlds after a step, with whom each vehicle serves now in those that go on, bool [B]."""
        lands, serves = lands_of(after), lands_of(after).serves
        pool = serves.shape[1] - self.count * self._owned(serves.shape[1])
        if self.lending == "fixed" or pool == 0:
            return after
        need = sums_by(lands.owner, worth_of(after) * is_burning(after.cells), self.count)
        lent = apportioned(need, pool)
        now = running & (after.step % self.term == 0) & (need > 0.0).any(dim=1)
        lent = torch.where(now[:, None], lent, serves[:, -pool:])
        serves = torch.cat((serves[:, :-pool], lent), dim=1)
        return after.with_planes(self.name, lands.replace(serves=serves))

    def metric_rows(self, world: Rules) -> tuple[Metric, ...]:
        """Return ``saved_agency_0`` and so on."""
        return tuple(Metric(f"saved_{name}", "more", title=name, table="saved by agency") for name in self.names)

    def metrics(self, state: WorldState) -> dict[str, Tensor]:
        """Return what stands of the trees on the land of each agency, by their worth; see ``standing``."""
        return {f"saved_{name}": left for name, left in zip(self.names, standing(state).unbind(1), strict=True)}

    def entries(self, world: Rules) -> tuple[str, ...]:
        """Return the agencies' names."""
        return self.names

    def status(self, state: WorldState) -> Tensor:
        """Return the agency that each vehicle serves, one-hot, float32 [B, A, K]."""
        return one_hot(lands_of(state).serves, self.count).to(torch.float32)

    def serves(self, state: WorldState) -> Tensor:
        """Return the agency that each vehicle serves, int64 [B, A]."""
        return lands_of(state).serves

    def own_land(self, state: WorldState) -> Tensor:
        """Return the cells of the agency that each vehicle serves, bool [B, A, H, W]."""
        return own_land(state)

    def picture_entries(self, world: Rules) -> tuple[str, ...]:
        """Return ``own_land``."""
        return ("own_land",)

    def picture(self, state: WorldState, side: int) -> Tensor:
        """Return the share of each block that is land of the agency that the vehicle serves."""
        lands = lands_of(state)
        shares = block_means(land_of_each(lands), side)
        return shares.gather(1, lands.serves[..., None, None].expand(-1, -1, side, side))[:, :, None]

    def critic_entries(self, world: Rules) -> tuple[str, ...]:
        """Return ``land_of_agency_0`` and so on, then ``vehicles_of_agency_0`` and so on."""
        return tuple(f"{what}_{name}" for what in ("land_of", "vehicles_of") for name in self.names)

    def critic(self, state: WorldState, side: int) -> Tensor:
        """Return the land of each agency, and how many vehicles serve it."""
        lands = lands_of(state)
        place = one_hot(block_of(state, side), side**2).to(torch.float32)
        agencies = torch.arange(self.count, device=place.device)[:, None]
        serving = (lands.serves[:, None] == agencies).to(torch.float32) @ place
        return torch.cat((block_means(land_of_each(lands), side), serving.unflatten(-1, (side, side))), dim=1)

    def _owned(self, n_agents: int) -> int:
        """Return how many of a team's vehicles each agency owns."""
        return n_agents // self.count if self.own is None else self.own

    def _parted(self, state: WorldState) -> tuple[Tensor, Tensor]:
        """Return whose each cell is, uint8 [B, H, W], and the (row, column) of the homes, int64 [B, K, 2] [cells]."""
        height, width = state.cells.shape[1:]
        device = state.cells.device
        turn = torch.arange(self.count, device=device) / self.count
        angle = 2.0 * math.pi * (uniform(state.key, 0, Stream.LANDS, (1,)) + turn)
        south, east = angle.sin(), angle.cos()
        row = torch.arange(height, device=device) - 0.5 * (height - 1)
        column = torch.arange(width, device=device) - 0.5 * (width - 1)
        along = row[:, None] * south[..., None, None] + column * east[..., None, None]  # [B, K, H, W]
        owner = along.argmax(dim=1).to(torch.uint8)
        away = _HOME * min(height, width)
        home = torch.stack((0.5 * (height - 1) + away * south, 0.5 * (width - 1) + away * east), dim=-1)
        return owner, home.round().to(torch.int64)

    def _starts(self, state: WorldState, owner: Tensor, homes: Tensor, serves: Tensor) -> Tensor:
        """Return the free cells nearest to each vehicle's home on its agency's land, int64 [B, A, 2] [cells]."""
        agents, (height, width) = len(serves), owner.shape[1:]
        taken = (state.cover == int(Cover.LAKE)) | is_burning(state.cells)
        taken = taken[:, None] | (owner[:, None] != torch.arange(self.count, device=owner.device)[:, None, None])
        order = distances_to(homes.flatten(0, 1), height, width)
        cells = first_free(order, taken.flatten(0, 1), agents).unflatten(0, (-1, self.count))
        earlier = (serves[:, None] == serves).tril(diagonal=-1).sum(dim=1)
        return cells[:, serves, earlier]


def apportioned(need: Tensor, seats: int) -> Tensor:
    """Return which agency each of so many vehicles is lent to, by the method of D'Hondt, int64 [B, seats].

    Vehicle after vehicle goes to the agency with the largest need / (1 + vehicles lent to it), the first one of equals.
    Those of one agency stand together, in the order of the agencies.

    Args:
        need: float32 [B, K], 0 or more.
        seats: Vehicles.
    """
    quotients = need[..., None] / torch.arange(1, seats + 1, device=need.device)
    first = quotients.flatten(1).sort(dim=1, descending=True, stable=True).indices[:, :seats]
    held = one_hot(first // seats, need.shape[1]).sum(dim=1).cumsum(dim=1)
    return (torch.arange(seats, device=need.device)[:, None] >= held[:, None]).sum(dim=-1)


def standing(state: WorldState) -> Tensor:
    """Return the share of its trees' worth that each agency has left, (T_p + T_e) / N0 of its land, float32 [B, K].

    It is 1 where there was none.
    """
    lands = lands_of(state)
    alive = state.initial & ~state.burned & is_tree(state.cells)
    left = sums_by(lands.owner, worth_of(state) * alive, lands.worth.shape[1])
    return torch.where(lands.worth > 0.0, left / lands.worth, 1.0)


def land_of_each(lands: Lands) -> Tensor:
    """Return the cells of each agency's land, bool [B, K, H, W]."""
    return lands.owner[:, None] == torch.arange(lands.worth.shape[1], device=lands.owner.device)[:, None, None]


def own_land(state: WorldState) -> Tensor:
    """Return the cells on the land of the agency that each vehicle serves, bool [B, A, H, W]."""
    lands = lands_of(state)
    return lands.owner[:, None] == lands.serves[..., None, None]


def lands_of(state: WorldState) -> Lands:
    """Return the lands of worlds, and whom each vehicle serves.

    Raises:
        ValueError: If there is but one agency.
    """
    if not state.keeps(Agencies.name):
        raise ValueError("worlds must have lands: choose agencies=several")
    return state.planes(Agencies.name, Lands)
