"""The parts of a world, fitted to each other: landscape, wind, fire, team, ignition and mechanics."""

from dataclasses import dataclass, field
from functools import cached_property

from warp_torchrl.world.air.wind import Uniform, Wind
from warp_torchrl.world.episode_rules import EpisodeRules
from warp_torchrl.world.ignition.ignition import Ignition, IgnitionSource
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.mechanics.groups import Agencies, OneAgency
from warp_torchrl.world.mechanics.mechanic import Mechanic
from warp_torchrl.world.team.hearing import Hearing
from warp_torchrl.world.team.knowledge import Belief, Full, Sensing
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.terrain.source import LandscapeSource, map_size


@dataclass(frozen=True, kw_only=True)
class Parts(EpisodeRules):
    """The parts of a world, each fitted to the others.

    Attributes:
        landscape: Where the ground comes from.
        wind: The air.
        fire: The automaton.
        team: The vehicles.
        ignition: Where the fire starts.
        sensing: What agents know of the fire.
        belief: What they believe beyond that.
        agencies: Whom the vehicles serve.
        mechanics: What else holds in these worlds, see ``loop``.

    Raises:
        ValueError: If a value is out of its range or the team does not fit on the map.
    """

    landscape: LandscapeSource = field(default_factory=Perlin)
    wind: Wind = field(default_factory=Uniform)
    fire: Automaton = field(default_factory=Fire)
    team: Team = field(default_factory=Team)
    ignition: IgnitionSource = field(default_factory=Ignition)
    sensing: Sensing = field(default_factory=Full)
    belief: Belief = field(default_factory=Belief)
    agencies: Agencies = field(default_factory=OneAgency)
    mechanics: tuple[Mechanic, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        height, width = self.size
        unpaced = self.wind.over(self.landscape)  # refuses a wind that does not fit the landscape
        object.__setattr__(self, "fire", self.fire.over(self.landscape, unpaced, self.side_of_cell))
        _ = self.air
        if self.team.n_agents > height * width // 4:
            raise ValueError(
                f"team.n_agents must be at most a quarter of the map's {height * width} cells, got {self.team.n_agents}"
            )
        names = [*self.fire.keeps, *(each.name for each in self.loop)]
        if len(set(names)) < len(names):
            raise ValueError(f"mechanics must be one of each name, got {', '.join(names)}")
        for each in reversed(self.loop):  # the last ones build on those before, and say what the user chose
            each.check(self)
        _ = self.lighting  # refuses an ignition that does not fit the landscape
        _ = self.igniting  # now: a compiled step cannot make it

    @property
    def size(self) -> tuple[int, int]:
        """Return the map's (H, W) [cells]."""
        return map_size(self.landscape.size)

    @property
    def is_flat(self) -> bool:
        """Return whether the ground of every world is flat, as the landscape says; one that does not say may not be."""
        return bool(getattr(self.landscape, "is_flat", False))

    @property
    def side_of_cell(self) -> float:
        """Return the side of a cell in force [m]."""
        return getattr(self.landscape, "cell_size", 30.0) if self.cell_size is None else self.cell_size

    @cached_property
    def air(self) -> Wind:
        """Return the wind on this landscape's map."""
        return self.wind.over(self.landscape).paced(self.fire.minutes)

    @cached_property
    def lighting(self) -> IgnitionSource:
        """Return the ignition on this landscape's map."""
        return self.ignition.over(self.landscape)

    @cached_property
    def hearing(self) -> Hearing:
        """Return who hears whom: as the mechanic of them says that sets limits to it, else all hear all."""
        return next((each for each in self.mechanics if isinstance(each, Hearing)), Hearing())

    @cached_property
    def metric_names(self) -> tuple[str, ...]:
        """Return the names of the metrics of its mechanics."""
        return tuple(row.name for each in self.loop for row in each.metric_rows(self))

    @cached_property
    def loop(self) -> tuple[Mechanic, ...]:
        """Return all mechanics in the order in which they begin and step, that of their turns and names.

        They are ``mechanics``, and those of the other parts that are mechanics too.
        """
        parts = (self.team, self.agencies, self.sensing, self.belief)
        found = (*self.mechanics, *(each for each in parts if isinstance(each, Mechanic)))
        return tuple(sorted(found, key=lambda each: (each.turn, each.name)))

    @cached_property
    def igniting(self) -> tuple[Mechanic, ...]:
        """Return the mechanics that light cells after a tick."""
        return tuple(each for each in self.loop if type(each).after_tick is not Mechanic.after_tick)
