"""Who moves each vehicle: the policy, the policy under an order, or a person. And what people are asked before."""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import torch
from torch import Tensor

from warp_torchrl.demonstrations.recording import Mover
from warp_torchrl.heuristics import idle_action
from warp_torchrl.live.order import Order
from warp_torchrl.nearest import did_you_mean
from warp_torchrl.world.team import Team

MOST_KEYS = 4
"""Acts of a person that wait for their steps; more would be done long after the keys were pressed."""


class Refused(ValueError):  # noqa: N818
    """What a person asked for cannot be done; one line says why."""


class Question(NamedTuple):
    """An act of the policy that waits for a person's word."""

    agent: int
    action: int


@dataclass
class Seat:
    """One vehicle's.

    Attributes:
        person: Who drives it; None leaves it to the policy.
        keys: Acts that wait for their steps, oldest first.
        order: What the policy works at; None leaves it free.
    """

    person: int | None = None
    keys: deque[int] = field(default_factory=deque)
    order: Order | None = None


class Crew:
    """The seats of a team, in a match of one world.

    A driven vehicle does what its person asked for, one act a step in the order of the keys, and idles without one. All
    others do what the policy proposes, under the mask of their order if they have one. Before an act of a kind in
    ``asks`` the policy needs a person's word.

    Args:
        team: The vehicles.
    """

    def __init__(self, team: Team) -> None:
        self.team = team
        self.seats = [Seat() for _ in range(team.n_agents)]
        self.asks: frozenset[str] = frozenset()
        """Names of the actions before which a person is asked."""
        self._answers: dict[Question, bool] = {}

    # What people do

    def take(self, agent: int, person: int) -> None:
        """Let a person drive a vehicle; an order that it had ends.

        Raises:
            Refused: If another person drives it.
        """
        seat = self.seats[agent]
        if seat.person not in (None, person):
            raise Refused(f"{self.name(agent)} is driven by another person")
        self.seats[agent] = Seat(person=person)

    def hand_back(self, agent: int, person: int) -> None:
        """Give a vehicle back to the policy.

        Raises:
            Refused: If the person does not drive it.
        """
        self._check_drives(agent, person)
        self.seats[agent] = Seat()

    def leave(self, person: int) -> list[str]:
        """Give all vehicles of a person who has gone back to the policy; return their names."""
        left = [agent for agent, seat in enumerate(self.seats) if seat.person == person]
        for agent in left:
            self.seats[agent] = Seat()
        return [self.name(agent) for agent in left]

    def press(self, agent: int, person: int, action: int) -> None:
        """Let a driven vehicle do an act in its next free step.

        Raises:
            Refused: If the person does not drive it, or too many acts wait.
        """
        self._check_drives(agent, person)
        keys = self.seats[agent].keys
        if len(keys) >= MOST_KEYS:
            raise Refused(f"{self.name(agent)} has {MOST_KEYS} acts to do first")
        keys.append(action)

    def order(self, agent: int, order: Order | None) -> None:
        """Send a vehicle that the policy moves to a sector; None frees it.

        Raises:
            Refused: If a person drives it.
        """
        if self.seats[agent].person is not None:
            raise Refused(f"{self.name(agent)} is driven by a person, and takes no order")
        self.seats[agent].order = order

    def ask_before(self, actions: Iterable[str]) -> None:
        """Choose the actions before which a person is asked.

        Raises:
            Refused: If the team has no action of a name.
        """
        names = frozenset(actions)
        for name in names - set(self.team.action_names):
            hint = did_you_mean(name, self.team.action_names)
            raise Refused(f"an action must be one of {', '.join(self.team.action_names)}, got {name}{hint}")
        self.asks = names

    def answer(self, question: Question, allow: bool) -> None:
        """Give a person's word on an act."""
        self._answers[question] = allow

    def restart(self) -> None:
        """Forget acts and answers of an episode that is over; who drives what, and the orders, stay."""
        self._answers.clear()
        for seat in self.seats:
            seat.keys.clear()

    # What the match asks

    def name(self, agent: int) -> str:
        """Return a vehicle's name."""
        return self.team.agent_names[agent]

    def mask(self, shown: Tensor, position: Tensor) -> Tensor:
        """Return the mask under which the policy chooses: what is shown, less what orders close.

        Args:
            shown: bool [A, actions].
            position: (row, column) of each vehicle, int64 [A, 2] [cells].
        """
        if not any(seat.order for seat in self.seats):
            return shown
        stride = self._strides()
        rows = [
            shown[agent] if seat.order is None else seat.order.mask(shown[agent], position[agent], stride[agent])
            for agent, seat in enumerate(self.seats)
        ]
        return torch.stack(rows)

    def questions(self, proposed: Tensor) -> list[Question]:
        """Return the acts of the policy that wait for a person's word; proposed are its actions, int64 [A]."""
        if not self.asks:
            return []
        acts = [Question(agent, action) for agent, action in enumerate(proposed.tolist())]
        return [
            each
            for each in acts
            if self.seats[each.agent].person is None
            and self.team.action_names[each.action] in self.asks
            and each not in self._answers
        ]

    def decide(
        self, proposed: Tensor, mask: Tensor, possible: Tensor, position: Tensor
    ) -> tuple[Tensor, list[Mover], list[str]]:
        """Return what each vehicle does in a step that has no open question, and forget what was asked for it.

        Args:
            proposed: The policy's actions, int64 [A].
            mask: Of ``mask``, bool [A, actions].
            possible: Which actions would do something, bool [A, actions].
            position: (row, column) of each vehicle, int64 [A, 2] [cells].

        Returns:
            Actions, int64 [A], whose each is, and a line for each act of a person that was refused.
        """
        action, idle, told = proposed.clone(), idle_action(possible, self.team), []
        movers = [Mover.POLICY] * self.team.n_agents
        for agent, seat in enumerate(self.seats):
            if seat.person is not None:
                action[agent], movers[agent], refusal = self._driven(agent, seat, possible[agent], int(idle[agent]))
                told += refusal
            elif self._answers.get(Question(agent, int(proposed[agent]))) is False:
                action[agent], movers[agent] = idle[agent], Mover.FORBIDDEN
            elif seat.order is not None:
                movers[agent] = Mover.ORDER
                if not mask[agent, proposed[agent]]:  # a baseline reads the world and not the mask
                    move = seat.order.nearest_move(mask[agent], position[agent], self._strides()[agent])
                    action[agent] = idle[agent] if move is None else move
        self._answers.clear()
        return action, movers, told

    def _driven(self, agent: int, seat: Seat, possible: Tensor, idle: int) -> tuple[int, Mover, list[str]]:
        if not seat.keys:
            return idle, Mover.WAITING, []
        wanted = seat.keys.popleft()
        if possible[wanted] or wanted == idle:
            return wanted, Mover.PERSON, []
        return idle, Mover.WAITING, [f"{self.name(agent)}: {self.team.action_names[wanted]} would do nothing here"]

    def _check_drives(self, agent: int, person: int) -> None:
        if self.seats[agent].person != person:
            raise Refused(f"{self.name(agent)} is not yours to drive: take it over first")

    def _strides(self) -> list[int]:
        return self.team.table(torch.device("cpu")).stride.tolist()
