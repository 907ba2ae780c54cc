"""Vehicles' actions, by the policy, by the policy under an order or by a person, and the policy's questions."""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import torch
from torch import Tensor

from warp_torchrl.demonstrations.recording import Mover
from warp_torchrl.heuristics import idle_action
from warp_torchrl.live.order import Order
from warp_torchrl.validation import did_you_mean
from warp_torchrl.world.team.team import Team

MOST_KEYS = 4
"""Acts of a person that wait for their steps; more would be done long after the keys were pressed."""


class Refused(ValueError):  # noqa: N818
    """A request of a person that cannot be done; one line gives the reason."""


class Question(NamedTuple):
    """An action of the policy that waits for a person's answer.

    Attributes:
        agent: Index of the vehicle.
        action: What the policy proposes.
        chance: Probability of the policy's most likely action, where it is so low that a person chooses the action;
            None where the action is of a kind that needs permission.
    """

    agent: int
    action: int
    chance: float | None = None


@dataclass
class Seat:
    """Control of one vehicle.

    Attributes:
        person: The person that drives it; None leaves it to the policy.
        keys: Actions that wait for their steps, oldest first.
        order: Sector in which the policy works; None leaves it free.
    """

    person: int | None = None
    keys: deque[int] = field(default_factory=deque)
    order: Order | None = None


class Crew:
    """The seats of a team, in a match of one world.

    A driven vehicle does what its person chose, one action per step in the order of the keys, and idles without one.
    All other vehicles do what the policy proposes, under the mask of their order if they have one. An action of a kind
    in ``asks`` needs a person's permission. Where the policy's most likely action is less likely than ``unsure_below``,
    a person chooses the action: the proposal, or another.

    Args:
        team: The vehicles.
    """

    def __init__(self, team: Team) -> None:
        self.team = team
        self.seats = [Seat() for _ in range(team.n_agents)]
        self.asks: frozenset[str] = frozenset()
        """Names of the actions before which a person is asked."""
        self.unsure_below: float | None = None
        """Probability of the most likely action below which a person is asked for the action; None asks for none."""
        self._answers: dict[tuple[int, int], bool] = {}  # by vehicle and proposed action
        self._chosen: dict[int, int] = {}  # action by vehicle

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
        """Give all vehicles of a person that left back to the policy; return their names."""
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

    def ask_where_unsure(self, below: float | None) -> None:
        """Set the probability of the policy's most likely action below which a person chooses; None: nobody does.

        Raises:
            Refused: If it is no probability.
        """
        if below is not None and not 0.0 <= below <= 1.0:
            raise Refused(f"a probability must be in [0, 1], got {below:g}")
        self.unsure_below = below

    def answer(self, question: Question, allow: bool) -> None:
        """Answer a question; if the policy was unsure of the action, allowing it chooses it."""
        if allow and question.chance is not None:
            self._chosen[question.agent] = question.action
        else:
            self._answers[question.agent, question.action] = allow

    def choose(self, question: Question, action: int, possible: Tensor) -> None:
        """Choose the action of a vehicle whose policy is unsure; it may be the policy's proposal.

        Args:
            question: The open question of the vehicle.
            action: Index of the chosen action.
            possible: Which actions would do something, bool [A, actions].

        Raises:
            Refused: If the action would do nothing.
        """
        agent = question.agent
        if not possible[agent, action] and action != int(idle_action(possible, self.team)[agent]):
            raise Refused(self._nothing(agent, action))
        self._chosen[agent] = action

    def restart(self) -> None:
        """Forget actions and answers of an episode that is over; drivers and orders stay."""
        self._forget()
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

    def questions(self, proposed: Tensor, chances: Tensor | None = None) -> list[Question]:
        """Return the acts of the policy that wait for a person, the one that it is least sure of first.

        Args:
            proposed: Its actions, int64 [A].
            chances: Probability of each action, float32 [A, actions]; None of a policy that has none.
        """
        free = [
            (agent, action)
            for agent, action in enumerate(proposed.tolist())
            if self.seats[agent].person is None and agent not in self._chosen and (agent, action) not in self._answers
        ]
        unsure: list[Question] = []
        if self.unsure_below is not None and chances is not None:
            top = chances.amax(dim=-1).tolist()
            asked = [Question(*each, top[each[0]]) for each in free if top[each[0]] < self.unsure_below]
            unsure = sorted(asked, key=lambda each: top[each.agent])
        known = {each.agent for each in unsure}
        return unsure + [
            Question(*each) for each in free if each[0] not in known and self.team.action_names[each[1]] in self.asks
        ]

    def decide(
        self, proposed: Tensor, mask: Tensor, possible: Tensor, position: Tensor
    ) -> tuple[Tensor, list[Mover], list[str]]:
        """Return each vehicle's action in a step without open questions, and forget the actions that people chose.

        Args:
            proposed: The policy's actions, int64 [A].
            mask: Of ``mask``, bool [A, actions].
            possible: Which actions would do something, bool [A, actions].
            position: (row, column) of each vehicle, int64 [A, 2] [cells].

        Returns:
            Actions, int64 [A], the mover of each vehicle, and a line for each action of a person that was refused.
        """
        action, idle, told = proposed.clone(), idle_action(possible, self.team), []
        movers = [Mover.POLICY] * self.team.n_agents
        for agent, seat in enumerate(self.seats):
            if seat.person is not None or agent in self._chosen:
                wanted = self._chosen.get(agent, seat.keys.popleft() if seat.keys else None)
                action[agent], movers[agent], refusal = self._asked_for(wanted, agent, possible[agent], idle[agent])
                told += refusal
            elif self._answers.get((agent, int(proposed[agent]))) is False:
                action[agent], movers[agent] = idle[agent], Mover.FORBIDDEN
            elif seat.order is not None:
                movers[agent] = Mover.ORDER
                if not mask[agent, proposed[agent]]:  # a baseline reads the world and not the mask
                    move = seat.order.nearest_move(mask[agent], position[agent], self._strides()[agent])
                    action[agent] = idle[agent] if move is None else move
        self._forget()
        return action, movers, told

    def _asked_for(
        self, wanted: int | None, agent: int, possible: Tensor, idle: Tensor
    ) -> tuple[int, Mover, list[str]]:
        """Return a driven vehicle's action, its mover, and the lines that report a refused action."""
        if wanted is None:
            return int(idle), Mover.WAITING, []
        if possible[wanted] or wanted == int(idle):
            return wanted, Mover.PERSON, []
        return int(idle), Mover.WAITING, [self._nothing(agent, wanted)]

    def _nothing(self, agent: int, action: int) -> str:
        return f"{self.name(agent)}: {self.team.action_names[action]} would do nothing here"

    def _forget(self) -> None:
        self._answers.clear()
        self._chosen.clear()

    def _check_drives(self, agent: int, person: int) -> None:
        if self.seats[agent].person != person:
            raise Refused(f"{self.name(agent)} is not yours to drive: take it over first")

    def _strides(self) -> list[int]:
        return self.team.table(torch.device("cpu")).stride.tolist()
