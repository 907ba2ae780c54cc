"""Mechanics: what a scenario adds to fire and team. Each is a folder here, a dataclass, and its planes of the state."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, NamedTuple, Protocol

from torch import Tensor

from warp_torchrl.world.air.wind import Wind
from warp_torchrl.world.ignition.ignition import IgnitionSource
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.state.role import RoleTable
from warp_torchrl.world.state.state import ActionResult, WorldState
from warp_torchrl.world.team.acting import Attempts, TakeEffect
from warp_torchrl.world.team.hearing import Hearing
from warp_torchrl.world.team.knowledge import Sensing
from warp_torchrl.world.team.team import Team


class Rules(Protocol):
    """What a mechanic may read of its world."""

    @property
    def team(self) -> Team:
        """Return the vehicles."""
        ...

    @property
    def sensing(self) -> Sensing:
        """Return what agents know."""
        ...

    @property
    def hearing(self) -> Hearing:
        """Return who hears whom."""
        ...

    @property
    def fire(self) -> Automaton:
        """Return the automaton."""
        ...

    @property
    def loop(self) -> Sequence["Mechanic"]:
        """Return its mechanics, in the order in which they act."""
        ...

    @property
    def steps_per_tick(self) -> int:
        """Return the agent steps to a fire tick."""
        ...

    @property
    def horizon(self) -> int:
        """Return the agent steps to an episode."""
        ...

    @property
    def air(self) -> Wind:
        """Return the wind."""
        ...

    @property
    def lighting(self) -> IgnitionSource:
        """Return the ignition."""
        ...


Unit = Literal["%", "1", "min", "ha", "USD"]
"""In which tables show a metric: shares in ``%``, or numbers as they are: ``1``, minutes, hectares, dollars."""


class Metric(NamedTuple):
    """A row of the metrics of episodes: a number of each world, a share in 0..1 where its unit is ``%``.

    Attributes:
        name: Of its entry in ``info``, ``metrics.csv`` and ``evaluation.json``.
        better: Whether more or less of it is better; empty, neither.
        unit: In which tables show it.
        title: What tables call it; empty, its name.
        table: Title of a table that it shares with other metrics, of one unit; empty, it has a table to itself.
    """

    name: str
    better: Literal["more", "less", ""] = ""
    unit: Unit = "%"
    title: str = ""
    table: str = ""


@dataclass(frozen=True, kw_only=True)
class Mechanic:
    """A mechanic of the world. Its fields are its configuration; each method is a socket, which by default is empty.

    Its tensors that change with the worlds are a ``Batch`` under its name in ``WorldState.extras``.

    Attributes:
        name: Of its planes in the state, and of its values in ``mechanics`` of the configuration.
        turn: Mechanics of a lower one begin and step first; those of the same one do in the order of their names.
        is_knowledge: Whether it is about what agents know alone; worlds that are imagined do without.
        is_hidden: Whether agents know of its planes in sight alone; worlds that a team imagines begin it again.
        maps: What agents may be shown of it: channels of their view by name, each a function of the worlds that returns
            whole numbers 0..255, uint8 [B, H, W], or [B, A, H, W] where each agent is shown another.
        baselines: Names of heuristics to which a policy is compared in its worlds, beside those of every table.
    """

    name: ClassVar[str] = ""
    turn: ClassVar[int] = 0
    is_knowledge: ClassVar[bool] = False
    is_hidden: ClassVar[bool] = False
    maps: ClassVar[Mapping[str, Callable[[WorldState], Tensor]]] = {}
    baselines: ClassVar[tuple[str, ...]] = ()

    def check(self, world: Rules) -> None:
        """Check that it fits a world.

        Raises:
            ValueError: If not.
        """

    def why_eager(self) -> str | None:
        """Return why steps of its worlds are not compiled; None where they can be."""
        return None

    def begin(self, state: WorldState, world: Rules) -> WorldState:
        """Return worlds at the start of an episode, after the head start of the fire, with its planes."""
        return state

    def masked(self, state: WorldState, mask: Tensor) -> Tensor:
        """Return which actions are open, bool [B, A, actions], of those that the agents' abilities allow."""
        return mask

    def around(self, state: WorldState, attempts: Attempts, take_effect: TakeEffect) -> tuple[WorldState, ActionResult]:
        """Return worlds after the agents' acts, and what each action came to; it may hold acts back.

        Args:
            state: The worlds after the moves, in which no cell has changed yet.
            attempts: What the agents are about to do.
            take_effect: Changes worlds by the attempts that it is given. Those whose ``acts`` are not set do nothing.
        """
        return take_effect(state, attempts)

    def due_at_base(self, state: WorldState, roles: RoleTable) -> Tensor | None:
        """Return which agents must set out for their base now, bool [B, A]; None where none ever has to."""
        return None

    def grounded(self, state: WorldState, roles: RoleTable) -> Tensor | None:
        """Return which agents cannot move, bool [B, A]; None where it keeps none."""
        return None

    def moved(self, state: WorldState, roles: RoleTable, running: Tensor) -> WorldState:
        """Return worlds after the agents' moves and before their other acts.

        Args:
            state: The worlds after the moves.
            roles: Of the agents.
            running: Worlds that have not ended, bool [B].
        """
        return state

    def after_tick(self, state: WorldState, ticks_now: Tensor, world: Rules) -> WorldState:
        """Return worlds after a tick of the fire, in which more cells may have caught fire.

        Args:
            state: The worlds after the tick and before the clock advances.
            ticks_now: Worlds in which the fire has ticked, bool [B]; the others stay the same.
            world: Their rules.
        """
        return state

    def smoulders(self, state: WorldState) -> Tensor | None:
        """Return in which worlds cells will catch fire though none may burn now, bool [B]; None: in none.

        Their episodes do not end without fire.
        """
        return None

    def step(self, before: WorldState, after: WorldState, running: Tensor, world: Rules) -> WorldState:
        """Return worlds after a step: agents have acted, the fire has ticked, and the clock has advanced.

        Args:
            before: The worlds before the step.
            after: The worlds after it.
            running: Worlds that had not ended before it, bool [B]; the others stay the same.
            world: Their rules.
        """
        return after

    def assumed(self, state: WorldState, world: Rules) -> WorldState | None:
        """Return the worlds as agents assume them to be; None where the mechanic says nothing of it.

        Their batch size is [B] where the team knows the same, and [B * A], a world for each agent, where not. The last
        mechanic that answers is heard.
        """
        return None

    def worth_seeing(self, state: WorldState, world: Rules) -> Tensor | None:
        """Return what agents would learn of each cell if they saw it now, float32 [B, 1 or A, H, W], 0 or more.

        None where the mechanic says nothing of it; the last one that answers is heard.
        """
        return None

    def believed_fire(self, state: WorldState, world: Rules) -> tuple[Tensor, Tensor] | None:
        """Return the chance of each cell to burn by fires that are known, and by those that nobody saw.

        Each is float32 [B, 1 or A, H, W]. None where the mechanic says nothing of it; the last one that answers is
        heard.
        """
        return None

    def futures(self, state: WorldState, world: Rules, count: int) -> WorldState | None:
        """Return worlds that may be the true ones as far as the team knows, ``count`` to each, batch size [B * count].

        None where the mechanic says nothing of it; the last one that answers is heard.
        """
        return None

    def fills_at_base(self, state: WorldState) -> Tensor | None:
        """Return whose tanks fill at the base alone, bool [B, A]; None where all fill at lakes too."""
        return None

    def workable(self, state: WorldState, world: Rules) -> Tensor | None:
        """Return the burning cells that some agent can put out from a cell beside them, bool [B, H, W].

        None where the mechanic forbids none. Heuristics leave the others.
        """
        return None

    def steps_to_clear(self, state: WorldState, world: Rules) -> Tensor | None:
        """Return how many steps of one agent it takes to clear each cell from now on, float32 [B, H, W], 1 or more.

        None where it takes one; the last mechanic that answers is heard.
        """
        return None

    def steps_to_put_out(self, state: WorldState, cells: Tensor) -> Tensor | None:
        """Return the steps that each agent alone takes to put out fires, float32 [B, A, K]; None where it takes one.

        ``inf`` where it cannot. The cells are flat indices, int64 [B, K].
        """
        return None

    def steps_here(self, state: WorldState) -> tuple[Tensor, Tensor] | None:
        """Return the steps that each agent alone takes where it is, to put out the fire and to clear its cell.

        float32 [B, A] each, ``inf`` where it cannot; None where each takes one.
        """
        return None

    def buildings(self, state: WorldState) -> Tensor | None:
        """Return the share that is left of what stands in each cell, float32 [B, H, W]; -1 where nothing stands.

        Pictures show it. None where the mechanic knows of no buildings; the last one that answers is heard.
        """
        return None

    def caption(self, state: WorldState) -> tuple[str, ...]:
        """Return what pictures of world 0 say of it in words."""
        return ()

    def metric_rows(self, world: Rules) -> tuple[Metric, ...]:
        """Return the rows of its metrics."""
        return ()

    def metrics(self, state: WorldState) -> dict[str, Tensor]:
        """Return the metrics of each world's episode so far, in their units, float32 [B] each by name."""
        return {}

    def degree(self, state: WorldState, goal: str) -> Tensor | None:
        """Return how well worlds do by a metric that is yes or no, float32 [B], more is better; planners compare it.

        None where the mechanic does not grade the metric.
        """
        return None

    def entries(self, world: Rules) -> tuple[str, ...]:
        """Return the names of the numbers that ``status`` tells each agent; none of them turns with the map."""
        return ()

    def status(self, state: WorldState) -> Tensor:
        """Return these numbers, float32 [B, A, F], in -3..3."""
        raise TypeError(f"{type(self).__name__} does not say what it tells: define status()")

    def picture_entries(self, world: Rules) -> tuple[str, ...]:
        """Return the names of its channels of ``picture``."""
        return ()

    def picture(self, state: WorldState, side: int) -> Tensor:
        """Return these channels in side x side blocks of the map, shares in 0..1, float32 [B, A, n, side, side]."""
        raise TypeError(f"{type(self).__name__} does not say what it shows: define picture()")

    def critic_entries(self, world: Rules) -> tuple[str, ...]:
        """Return the names of its planes of the central critic's ``state``."""
        return ()

    def critic(self, state: WorldState, side: int) -> Tensor:
        """Return these planes in side x side blocks of the map, in -3..256, float32 [B, n, side, side]."""
        raise TypeError(f"{type(self).__name__} does not say what the critic sees: define critic()")
