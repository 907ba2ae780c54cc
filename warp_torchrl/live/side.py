"""One team on a fire, or the fire without a team: an environment of one world, its player and its curves."""

from dataclasses import dataclass, field

import torch
from tensordict import TensorDictBase
from torch import Tensor

from warp_torchrl.demonstrations.events import Event, carry_out
from warp_torchrl.demonstrations.recording import OpenRecording, Recording
from warp_torchrl.env import WildfireEnv
from warp_torchrl.live.crew import Crew, Question, Refused
from warp_torchrl.live.order import Order
from warp_torchrl.live.player import Player
from warp_torchrl.models import ACTION, ACTION_MASK
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.world.arrays.geometry import DIRECTIONS
from warp_torchrl.world.state.state import Transition, WorldState


@dataclass
class Curves:
    """Results of an episode: one number for its start and one for each step since.

    Attributes:
        saved: Share of the initial trees that stand, in 0..1.
        burning: Share that burns, in 0..1.
        extinguished: Fires put out by each vehicle so far, int64 [A].
        cleared: Cells cleared by each vehicle so far, int64 [A].
    """

    saved: list[float] = field(default_factory=list)
    burning: list[float] = field(default_factory=list)
    extinguished: Tensor = field(default_factory=lambda: torch.zeros(0, dtype=torch.int64))
    cleared: Tensor = field(default_factory=lambda: torch.zeros(0, dtype=torch.int64))


class Side:
    """A team on a fire.

    A step has two parts: ``questions`` lets the policy propose its actions, once, and ``step`` does them.

    Args:
        env: Of one world.
        player: Its policy.
        environment: The environment's configuration.
    """

    def __init__(self, env: WildfireEnv, player: Player, environment: SavedConfig) -> None:
        self.env, self.player, self.crew, self.environment = env, player, Crew(env.world.team), environment
        self.world = env.world
        env.watcher = self._count
        self.chances: Tensor | None = None
        """Probability of each action at the last proposal, float32 [A, actions]; None of a policy that has none."""

    @property
    def state(self) -> WorldState:
        """Return the state of the world, batch size [1]."""
        return self.env.shared_state

    @property
    def ended(self) -> bool:
        """Return whether the episode is over."""
        return bool(self.state.done[0])

    @property
    def possible(self) -> Tensor:
        """Return which actions would do something, bool [A, actions]."""
        return self.env.world.possible_actions(self.state)[0]

    @property
    def mask(self) -> Tensor:
        """Return the mask under which the policy chooses, orders included, bool [A, actions]."""
        return self.crew.mask(self.shown[ACTION_MASK][0], self.state.vehicles.position[0])

    def restart(self, seed: int) -> None:
        """Start the episode of a seed, in the scenario's own wind."""
        self.shown = self._reset(seed)
        agents = self.env.n_agents
        self.facing = torch.full((agents,), -1)
        """Direction of each vehicle's last move, 0..7 clockwise from north; -1 before the first, int64 [A]."""
        self.curves = Curves(
            extinguished=torch.zeros(agents, dtype=torch.int64), cleared=torch.zeros(agents, dtype=torch.int64)
        )
        self.open_recording, self.seed = OpenRecording(), seed
        self.crew.restart()
        self.player.restart(seed)
        self._proposed: Tensor | None = None
        self._note()

    def questions(self) -> list[Question]:
        """Return the acts of the next step that wait for a person's word; none where the episode is over."""
        if self.ended:
            return []
        if self._proposed is None:
            self._proposed, self.chances = self.player.act(self.shown.copy().set(ACTION_MASK, self.mask[None]))
        return self.crew.questions(self._proposed, self.chances)

    def ask_where_unsure(self, below: float | None) -> None:
        """Let a person choose where the policy's most likely action is less likely than this; None: nobody does.

        Raises:
            Refused: If it is no probability, or the policy has none.
        """
        self.questions()
        if below is not None and self.chances is None and not self.ended:
            raise Refused(f"{self.player.name} has no action probabilities: it cannot tell how sure it is")
        self.crew.ask_where_unsure(below)

    def choose(self, question: Question, action: int) -> None:
        """Choose the action of a vehicle whose policy is unsure.

        Raises:
            Refused: If the action would do nothing.
        """
        self.crew.choose(question, action, self.possible)

    def step(self) -> list[str]:
        """Do the step that ``questions`` proposed; return a line for each act of a person that was refused."""
        if self.ended or self._proposed is None:
            return []
        position = self.state.vehicles.position[0]
        action, movers, told = self.crew.decide(self._proposed, self.mask, self.possible, position)
        before, self.shown = self.shown, self.env.step(self.shown.set(ACTION, action[None]))["next"]
        self.open_recording.add(before, self._proposed, movers, self.shown)
        self._proposed = None
        self._note()
        return told

    def order(self, agent: int, order: Order | None) -> None:
        """Send a vehicle to a sector, or free it; drop the policy's proposal under the former order.

        Raises:
            Refused: If a person drives it.
        """
        self.crew.order(agent, order)
        self._proposed = None

    def record(self) -> Recording:
        """Return the episode as it was played so far.

        Raises:
            Refused: If nothing was played.
        """
        if not self.open_recording.rows:
            raise Refused("nothing was played yet: there is no step to keep")
        return Recording(
            steps=self.open_recording.steps(),
            environment=self.environment,
            seed=self.seed,
            events=tuple(self.open_recording.events),
            policy=self.player.name,
            frames=self.player.frames,
            agents=tuple(self.env.agent_names),
            actions=tuple(self.env.action_names),
            saved=self.curves.saved[-1],
        )

    def intervene(self, kind: str, *numbers: float) -> None:
        """Let an event happen, one of ``EVENT_KINDS``: what people do to the world.

        Raises:
            ValueError: If a number is out of its range.
        """
        row, column = numbers
        event = Event(step=len(self.open_recording.rows), kind=kind, numbers=(float(row), float(column)))
        self.shown = carry_out(self.env, event)
        self.open_recording.events.append(event)
        self._proposed = None
        self.curves.saved.pop()
        self.curves.burning.pop()
        self._note()

    def _reset(self, seed: int) -> TensorDictBase:
        self.env.world = self.world
        self.env.set_seeds([seed])
        return self.env.reset()

    def _note(self) -> None:
        counts = self.env.tree_counts
        self.curves.saved.append(float(counts.saved()[0]))
        self.curves.burning.append(float(counts.burning[0] / counts.initial[0]))

    def _count(self, transition: Transition) -> None:
        moves = transition.result.moved[0] & (transition.result.action[0] < len(DIRECTIONS))
        self.facing = torch.where(moves, transition.result.action[0], self.facing)
        self.curves.extinguished += transition.result.extinguished[0]
        self.curves.cleared += transition.result.cleared[0]
