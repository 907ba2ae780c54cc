"""The features of an observation's entries: tables of functions by name, a row for each number or plane, or a few.

A row says what its numbers or planes are called, how they turn with the map, what they can hold, and where they are
shown. Specs, signatures and packings read the rows; an entry is what their functions return, side by side.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

from torch import Tensor

from warp_torchrl.entries import Content, Empty, Part
from warp_torchrl.validation import check_new_name
from warp_torchrl.world.mechanics.mechanic import Mechanic
from warp_torchrl.world.mechanics.table import kinds
from warp_torchrl.world.state.records import in_sight
from warp_torchrl.world.state.state import Forecast, WorldState
from warp_torchrl.world.world import World

Function = TypeVar("Function", bound=Callable[..., Tensor])
Map = Callable[[WorldState], Tensor]
"""A map of a mechanic, see ``Mechanic.maps``."""


@dataclass(frozen=True, kw_only=True)
class Choice:
    """What an observation shows beside what every observation shows.

    Attributes:
        identity: The agent's place in its team, see ``status.identity``.
        rules: The rules of the world, see ``rules.rules_of``.
        water: The way to water, see ``water.way_to_water``.
        ways: The ways to other places, by their names, see ``ways.WAYS``.
        advice: What a heuristic would have the agent do, see ``advice.advised_actions``, by its name; empty, none.
        reach: How soon fire and team can be where, see ``critic.reach_of_fire_and_team``; to the critic alone.
        features: Further features by name, in order.
    """

    identity: bool = False
    rules: bool = False
    water: bool = False
    ways: tuple[str, ...] = ()
    advice: str = ""
    reach: bool = False
    features: tuple[str, ...] = ()


NOTHING_MORE = Choice()
"""What shows what every observation shows, and nothing else."""


@dataclass(frozen=True, eq=False)  # torch 2.11 hashes what a compiled function makes before its fields are there
class Context:
    """What a number of ``status`` or a plane of ``state`` is computed of."""

    state: WorldState
    world: World
    forecast: Forecast
    choice: Choice
    kept: dict[str, Any] = field(default_factory=dict)  # results that several functions need, by name

    @cached_property
    def assumed(self) -> WorldState:
        """Return the worlds as agents assume them to be, see ``World.assumed``."""
        return self.world.assumed(self.state)


IsThere = Callable[[World, Choice], bool]
"""Whether a feature is shown in a world."""
Holds = Callable[[World, Sequence[str]], Content | tuple[Content, ...]]
"""What planes can hold in a world, all of them or each, beside the planes of the entry by name."""


class Feature(NamedTuple):
    """A row of a table."""

    show: Callable[..., Tensor]
    """Returns the numbers or planes, of what the table's functions read."""
    parts: Callable[[World], Sequence[Part]]
    """Returns their names in a world, and how they turn; planes are of kind ``plane``, ``target`` or ``agents``."""
    content: Holds
    """Returns what its planes can hold."""
    high: int
    """The largest whole number of a plane that is shown in whole numbers."""
    is_there: IsThere | None
    """Returns whether it is shown in a world; None where an observation chooses it by name."""


class Features(dict[str, Feature]):
    """The features of an entry, by name and in order.

    Args:
        what: A feature is called in messages.
    """

    def __init__(self, what: str) -> None:
        super().__init__()
        self.what = what

    def add(
        self,
        parts: Callable[[World], Sequence[Part]] | Sequence[Part],
        content: Holds,
        high: int,
        is_there: IsThere | None,
    ) -> Callable[[Function], Function]:
        """Return what adds a function to the table, under the function's name; see ``Feature``.

        Raises:
            ValueError: If another module's feature has the name, or ``high`` is not in 1..255.
        """
        if not 1 <= high <= 255:
            raise ValueError(f"high must be in 1..255, got {high}")

        def added(show: Function) -> Function:
            name = show.__name__
            check_new_name(self.what, name, show, self[name].show if name in self else None)
            self[name] = Feature(show, parts if callable(parts) else lambda world: parts, content, high, is_there)
            return show

        return added

    def shown(self, world: World, choice: Choice) -> list[Feature]:
        """Return the features that a world has, in order, then those that are chosen by name."""
        there = [each for each in self.values() if each.is_there is not None and each.is_there(world, choice)]
        return there + [self[name] for name in choice.features if name in self]


def add_maps(table: Features, in_entry: Callable[[str, Map], Callable[..., Tensor]], is_of_agents: bool = True) -> None:
    """Add to a table the maps of mechanics (``Mechanic.maps``), which are chosen by name and empty in worlds without.

    Args:
        table: Of an entry.
        in_entry: Returns the function of a row, given the name of the mechanic's planes in the state, and the map.
        is_of_agents: Whether agents are shown the entry: hidden mechanics (``Mechanic.is_hidden``) in sight alone.
    """
    for kind in kinds():
        for name, show in kind.maps.items():
            check_new_name(table.what, name, show, table[name].show if name in table else None)
            shown = _in_sight(show) if is_of_agents and kind.is_hidden else show
            table[name] = _row_of_map(kind, name, in_entry(kind.name, shown))


def _in_sight(show: Map) -> Map:
    """Return a map of what each agent sees now, 0 elsewhere; all of it where all agents see all."""

    def shown(state: WorldState) -> Tensor:
        plane, seen = show(state), in_sight(state)
        return plane if seen is None else plane[:, None] * seen

    return shown


def _row_of_map(kind: type[Mechanic], name: str, show: Callable[..., Tensor]) -> Feature:
    def content(world: World, names: Sequence[str]) -> Content:
        return None if any(isinstance(each, kind) for each in world.loop) else Empty()

    return Feature(show, lambda world: [Part("plane", (name,))], content, 255, None)


def anything(world: World, names: Sequence[str]) -> Content:
    """Return that a plane may hold anything."""
    return None


def everywhere(world: World, choice: Choice) -> bool:
    """Return that a feature is shown in every world."""
    return True


def known_in_part(world: World, choice: Choice) -> bool:
    """Return whether agents keep records of the fire, and may not know all of it."""
    return world.sensing.is_limited


def parts_of(features: Sequence[Feature], world: World) -> tuple[Part, ...]:
    """Return the parts of features in a world.

    Raises:
        ValueError: If two numbers or planes have one name.
    """
    parts = tuple(part for each in features for part in each.parts(world))
    names = [name for part in parts for name in part.names]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise ValueError(f"features of an entry must have different names, got {twice[0]} twice")
    return parts


def names_of(features: Sequence[Feature], world: World) -> tuple[str, ...]:
    """Return the names of the numbers or planes of features in a world."""
    return tuple(name for part in parts_of(features, world) for name in part.names)


def highs_of(features: Sequence[Feature], world: World) -> tuple[int, ...]:
    """Return the largest whole number of each plane of features in a world."""
    return tuple(each.high for each in features for part in each.parts(world) for _ in part.names)


def content_of(features: Sequence[Feature], world: World) -> tuple[Content, ...]:
    """Return what each plane of features can hold in a world."""
    names, found = names_of(features, world), list[Content]()
    for each in features:
        held = each.content(world, names)
        count = sum(len(part.names) for part in each.parts(world))
        found += held if isinstance(held, tuple) else [held] * count
    return tuple(found)


def first_of(kind: str, features: Sequence[Feature], world: World) -> tuple[int, int] | None:
    """Return the index and the count of the first planes of a kind, None where there are none."""
    first = 0
    for part in parts_of(features, world):
        if part.kind == kind:
            return first, len(part.names)
        first += len(part.names)
    return None


def check_features(names: Sequence[str], tables: Sequence[Features]) -> None:
    """Check a choice of further features.

    Raises:
        ValueError: If one is in none of the tables, need not be chosen, or is named twice.
    """
    known = {name: None for table in tables for name, each in table.items() if each.is_there is None}
    unknown = [name for name in names if name not in known]
    if unknown or len(set(names)) < len(names):
        got = unknown[0] if unknown else list(names)
        raise ValueError(f"features must be a list of different names of {', '.join(known) or 'none'}, got {got}")
