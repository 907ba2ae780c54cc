"""A recording: the steps of one episode as TorchRL data, with their configuration."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from warp_torchrl.demonstrations.events import Event
from warp_torchrl.models import ACTION, ACTION_MASK, OBSERVATION, REWARD
from warp_torchrl.runs.config.saved_config import SavedConfig

PROPOSED, MOVER = ("agents", "proposed"), ("agents", "mover")
ROLE = ("agents", "role")
_SHOWN = (OBSERVATION, ACTION_MASK, ROLE)
_ENDS = (REWARD, "done", "terminated", "truncated")


class Mover(IntEnum):
    """Source of an agent's action."""

    POLICY = 0
    ORDER = 1
    """The policy's, under an order of a person."""
    PERSON = 2
    WAITING = 3
    """None: the person who drives the vehicle asked for nothing in this step, or for what would do nothing."""
    FORBIDDEN = 4
    """None: a person forbade what the policy proposed."""


@dataclass(frozen=True, kw_only=True)
class Recording:
    """An episode, from its start to wherever it was left.

    Attributes:
        steps: Batch size [T], as TorchRL's collectors have it: what each agent saw, ``("agents", "observation")`` and
            ``("agents", "action_mask")``; what it did, ``("agents", "action")`` int64 [T, A]; what the policy proposed,
            ``("agents", "proposed")`` int64 [T, A]; whose the action was, ``("agents", "mover")`` uint8 [T, A], see
            ``Mover``; ``("next", "agents", "reward")`` float32 [T, A, 1]; and ``("next", "done")``,
            ``("next", "terminated")``, ``("next", "truncated")``, bool [T, 1].
        environment: Its configuration.
        seed: Of the episode, which is the seed's first.
        events: What people did to the world, in their order.
        policy: What it is called.
        frames: World steps that the policy was trained for; None for a baseline.
        agents: Names of the agents.
        actions: Names of the actions.
        saved: Share of the initial trees that stand where it was left, in 0..1; None if nobody has counted them.
    """

    steps: TensorDictBase
    environment: SavedConfig
    seed: int
    events: tuple[Event, ...]
    policy: str
    frames: int | None
    agents: tuple[str, ...]
    actions: tuple[str, ...]
    saved: float | None = None

    @property
    def scenario(self) -> str:
        """Return the name of its scenario."""
        return self.environment.choices["scenario"]

    def by(self, mover: Mover) -> Tensor:
        """Return which actions were whose, bool [T, A]."""
        return self.steps[MOVER] == mover

    def corrected(self) -> Tensor:
        """Return where a person did other than the policy proposed, bool [T, A]."""
        return self.by(Mover.PERSON) & (self.steps[ACTION] != self.steps[PROPOSED])


def step_record(shown: TensorDictBase, proposed: Tensor, mover: Tensor, after: TensorDictBase) -> TensorDictBase:
    """Return the record of a step of any number of worlds, batch size [B].

    Args:
        shown: Of an environment, with the actions done.
        proposed: The policy's actions, int64 [B, A].
        mover: Whose each action was, uint8 [B, A].
        after: What the step led to.
    """
    row = shown.select(*_SHOWN, ACTION, strict=False).clone()
    row[PROPOSED], row[MOVER] = proposed.clone(), mover.clone()
    row["next"] = after.select(*_ENDS).clone()
    return row


@dataclass
class OpenRecording:
    """The steps of an episode that is being played, or of one in each of several worlds.

    Attributes:
        rows: A TensorDict of batch size [], or [B], for each step.
        events: People's changes to the world.
        acts: Actions of people so far.
        corrections: Actions of people that the policy had not proposed.
        words: Actions under an order, or instead of a forbidden one.
    """

    rows: list[TensorDictBase] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    acts: int = 0
    corrections: int = 0
    words: int = 0

    @property
    def has_people(self) -> bool:
        """Return whether a person did anything: drove, chose, ordered, forbade, or changed the world."""
        return bool(self.acts or self.words or self.events)

    def add(self, shown: TensorDictBase, proposed: Tensor, movers: Sequence[Mover], after: TensorDictBase) -> None:
        """Add a step.

        Args:
            shown: Of an environment of one world, with the actions done.
            proposed: The policy's actions, int64 [A].
            movers: Of each agent.
            after: What the step led to.
        """
        whose = torch.tensor(movers, dtype=torch.uint8)
        row = step_record(shown, proposed[None], whose[None], after)[0].clone()
        self.rows.append(row)
        others = (row[ACTION] != proposed).tolist()
        self.acts += sum(each == Mover.PERSON for each in movers)
        self.corrections += sum(each == Mover.PERSON and other for each, other in zip(movers, others))
        self.words += sum(each in (Mover.ORDER, Mover.FORBIDDEN) for each in movers)

    def steps(self) -> TensorDictBase:
        """Return the steps, at least one, batch size [T] or [T, B]."""
        steps = torch.stack(self.rows)
        if not isinstance(steps, TensorDict):
            raise TypeError(f"the steps of a recording must be of one kind, got {type(steps).__name__}")
        return steps
