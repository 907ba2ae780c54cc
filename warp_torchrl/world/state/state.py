"""State of the worlds: the batches that every other module reads, and the public codes.

Letters, everywhere: B worlds, A agents, H rows, W columns.
"""

from dataclasses import dataclass, field
from enum import IntEnum
from typing import TypeVar, cast

from torch import Tensor

from warp_torchrl.world.arrays.batch import Batch, Named


class Cover(IntEnum):
    """Land cover of a cell (WARP-CA, terrain types), and ``BARE``, which only rasters use."""

    LAKE = 0
    WETLAND = 1
    GRASSLAND = 2
    FOREST = 3
    BARE = 4


class Action(IntEnum):
    """The paper's ten actions A = {0..9}, and ``STAY`` where a team may stay. 0..7 move N, NE, E, SE, S, SW, W, NW.

    These are the first actions of every team; those of other abilities follow, see ``Team.action_names``.
    """

    NORTH = 0
    NORTH_EAST = 1
    EAST = 2
    SOUTH_EAST = 3
    SOUTH = 4
    SOUTH_WEST = 5
    WEST = 6
    NORTH_WEST = 7
    EXTINGUISH = 8
    CLEAR = 9
    STAY = 10


EMPTY = 0
"""Cell code of bare ground, ash, lakes and firebreaks."""
OLDEST = 10
"""Cell code of the oldest tree; 1..10 are ages."""
FIRST_FIRE = 11
"""Cell code of the first burning stage; 11..15 burn."""
EMBER = 15
"""Cell code of the last stage."""


Planes = TypeVar("Planes", bound=Batch)


@dataclass(eq=False, repr=False)
class Landscape(Batch):
    """The ground of each world, fixed for an episode."""

    cover: Tensor  # uint8 [B,H,W], a Cover code
    age: Tensor  # uint8 [B,H,W], tree age before the fire, 0..10
    elevation: Tensor | None  # float32 [B,H,W] [m]; None where every world is flat
    corner: Tensor | None = None  # int64 [B,2], (row, column) of the map's first cell in its source; None: at (0, 0)
    layers: Named = field(default_factory=Named)  # what else the source knows of each cell, see ``layer``

    def layer(self, name: str) -> Tensor | None:
        """Return a layer of the source; None where it has none of this name.

        ``fuel`` holds class codes, int16 [B, H, W]; ``assets`` what each cell is worth, in any unit; ``canopy_cover``
        [%], ``canopy_height``, ``canopy_base_height`` [m] and ``canopy_bulk_density`` [kg/m3] are 0 without trees:
        float32 [B, H, W].
        """
        return self.layers.held.get(name)

    def with_layers(self, **layers: Tensor) -> "Landscape":
        """Return the landscapes with more layers, by name."""
        return self.replace(layers=self.layers.replace(**layers))


@dataclass(eq=False, repr=False)
class TreeCounts(Batch):
    """Counts of the initial trees by fate; they add up to ``initial`` (trees that regrow are counted apart)."""

    initial: Tensor  # int32 [B], N0, trees before ignition
    preserved: Tensor  # int32 [B], T_p, alive, untouched by fire or agents
    extinguished: Tensor  # int32 [B], T_e, alive, put out at least once
    cleared: Tensor  # int32 [B], T_c, turned into firebreak
    burned: Tensor  # int32 [B], T_b, burned to ash at least once
    burning: Tensor  # int32 [B], on fire for the first time
    alight: Tensor  # int32 [B], every burning cell of the map, regrown trees included

    def saved(self) -> Tensor:
        """Return the share of the initial trees that stand: (T_p + T_e) / N0, float32 [B]."""
        return (self.preserved + self.extinguished) / self.initial


@dataclass(eq=False, repr=False)
class Vehicles(Batch):
    """The team on the map."""

    position: Tensor  # int64 [B,A,2], (row, column) [cells]
    tank: Tensor  # int32 [B,A], water left [extinguish acts]; -1 without a tank
    last_action: Tensor  # int64 [B,A], -1 before the first
    base: Tensor  # int64 [B,2], (row, column) of the corner where the team started [cells]
    acts: Tensor  # int32 [B,A], extinguish and clear actions chosen so far
    redundant: Tensor  # int32 [B,A], those on a target that a team-mate had
    last_useful: Tensor  # int32 [B,A], step of the last credited act; -1 before the first


@dataclass(eq=False, repr=False)
class Ground(Batch):
    """A landscape and all that follows from it for the fire; ``Automaton.ground`` makes it."""

    landscape: Landscape
    alpha: Tensor  # float32 [B,H,W], flammability
    terms: Batch = field(default_factory=Batch)  # what else its law makes of it, in a class of the law; or nothing
    cell_size: float = 30.0  # side of a cell [m]


@dataclass(eq=False, repr=False)
class Air(Batch):
    """A wind and all that follows from it for the fire; ``world.backends.backend.air`` makes it."""

    wind: Tensor  # float32 [B,2,1,1] or [B,2,H,W], (u east, v north) of the air's motion [m/s]
    moisture: Tensor | None = None  # float32 [B,7] [%], see ``Wind.moisture``; None where the fire's own holds
    terms: Batch = field(default_factory=Batch)  # what else its law makes of it, in a class of the law; or nothing


@dataclass(eq=False, repr=False)
class Forecast(Batch):
    """What the fire is about to do in the next tick; it follows from a state, and is passed along with it."""

    expected_ignitions: Tensor  # float32 [B,H,W], neighbours that a burning cell ignites in the mean / 4, at most 1
    ignition_probability: Tensor  # float32 [B,H,W], of each tree
    fuel: Tensor  # float32 [B,H,W], flammability of each tree that does not burn

    def fire_risk(self) -> Tensor:
        """Return where the fire is about to grow, float32 [B, H, W] in 0..1.

        Of a burning cell its ``expected_ignitions``, and of a tree its ``ignition_probability``: no cell has both.
        """
        return self.expected_ignitions + self.ignition_probability


@dataclass(eq=False, repr=False)
class WorldState(Batch):
    """What changes in the worlds, and the ground and air that it changes in; batch size [B].

    Ground and air are replaced whole: there is no way to change the wind without what follows from it.
    """

    ground: Ground
    air: Air
    cells: Tensor  # uint8 [B,H,W], 0 empty, 1..10 tree age, 11..15 fire
    age: Tensor  # uint8 [B,H,W], age a burning tree had when it caught fire, else 0
    stage_age: Tensor | None  # uint8 [B,H,W], ticks burned in the present stage; None where a stage lasts one tick
    initial: Tensor  # bool [B,H,W], had a tree before ignition
    extinguished: Tensor  # bool [B,H,W], was put out at least once
    burned: Tensor  # bool [B,H,W], has burned to ash at least once
    firebreak: Tensor  # bool [B,H,W], cleared by an agent
    wet: Tensor  # uint8 [B,H,W], ticks for which the cell cannot ignite
    vehicles: Vehicles
    key: Tensor  # int64 [B], key of the world's draws in this episode
    step: Tensor  # int32 [B], agent steps since the start of the episode
    tick: Tensor  # int32 [B], fire ticks since ignition
    burning_area: Tensor  # float32 [B], sum over steps of burning initial trees / N0, the area under the fire's curve
    terminated: Tensor  # bool [B], no cell burns any more
    truncated: Tensor  # bool [B], the horizon was reached
    origin: Tensor | None = None  # int64 [B], key of what began with the episode, in imagined worlds; None: ``key``
    extras: Named = field(default_factory=Named)  # planes of each mechanic, and of the law, by its name

    def planes(self, name: str, kind: type[Planes]) -> Planes:
        """Return what a mechanic or a law keeps in the worlds.

        Args:
            name: Of the mechanic or the law.
            kind: Of its planes.

        Raises:
            ValueError: If the worlds have none: the mechanic or the law did not begin them.
        """
        if not self.keeps(name):
            raise ValueError(f"worlds must have planes of {name}, got those of {', '.join(self.extras.held) or 'none'}")
        return cast("Planes", self.extras.held[name])

    def keeps(self, name: str) -> bool:
        """Return whether a mechanic or a law keeps planes in the worlds."""
        return name in self.extras.held

    def plane(self, name: str, part: str) -> Tensor | None:
        """Return one tensor of a mechanic or a law, for readers that do without it; None where there is none."""
        found = self.extras.held.get(name)
        return None if found is None else getattr(found, part, None)

    def without_planes(self, *names: str) -> "WorldState":
        """Return the worlds without what some mechanics keep."""
        return self.replace(extras=Named({name: each for name, each in self.extras.held.items() if name not in names}))

    def with_planes(self, name: str, planes: Batch) -> "WorldState":
        """Return the worlds with other planes of a mechanic or a law."""
        return self.replace(extras=self.extras.replace(**{name: planes}))

    def what_changes(self) -> dict[str, Tensor]:
        """Return all tensors by name but those that follow from others, of which they can be made again."""
        return {name: leaf for name, leaf in self.leaves().items() if not name.startswith(_FOLLOWS)}

    @property
    def episode_key(self) -> Tensor:
        """Return the key of what began with the episode, int64 [B]: the true one in worlds that are imagined too."""
        return self.key if self.origin is None else self.origin

    @property
    def landscape(self) -> Landscape:
        """Return the landscapes."""
        return self.ground.landscape

    @property
    def alpha(self) -> Tensor:
        """Return the flammability of the ground, float32 [B, H, W]."""
        return self.ground.alpha

    @property
    def wind(self) -> Tensor:
        """Return the wind, float32 [B, 2, 1, 1] or [B, 2, H, W], (u east, v north) of the air's motion [m/s]."""
        return self.air.wind

    @property
    def cover(self) -> Tensor:
        """Return the land cover, uint8 [B, H, W], a ``Cover`` code."""
        return self.landscape.cover

    @property
    def done(self) -> Tensor:
        """Return which worlds have ended, bool [B]."""
        return self.terminated | self.truncated


_FOLLOWS = ("ground.alpha", "ground.terms.", "air.terms.")


@dataclass(eq=False, repr=False)
class ActionResult(Batch):
    """What each agent's action of one step came to."""

    action: Tensor  # int64 [B,A], as chosen
    moved: Tensor  # bool [B,A], changed cell
    credited: Tensor  # bool [B,A], did what it should to its target, and first of those who did
    redundant: Tensor  # bool [B,A], acted on a target that a team-mate of lower index took
    target: Tensor  # int64 [B,A], flat index of the cell acted on, valid where credited or redundant

    @property
    def extinguished(self) -> Tensor:
        """Return which agents put a fire out, credited, bool [B, A]."""
        return self.credited & (self.action == int(Action.EXTINGUISH))

    @property
    def cleared(self) -> Tensor:
        """Return which agents cleared a tree, credited, bool [B, A]."""
        return self.credited & (self.action == int(Action.CLEAR))


@dataclass(eq=False, repr=False)
class Transition(Batch):
    """One step of every world: all that rewards, metrics and pictures read."""

    before: WorldState
    result: ActionResult
    after: WorldState
    counts_before: TreeCounts  # of ``before``
    counts_after: TreeCounts  # of ``after``
