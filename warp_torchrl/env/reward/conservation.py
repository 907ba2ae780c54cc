"""The paper's five conservation rewards.

    Q = (w_p T_p + w_e T_e - w_c T_c - w_b T_b) / N0      (WARP-CA, conservation metric)

is the value of the forest, and A_total counts extinguish and clear, at c = w_a / N0 each. Each reward
computes a value R from them, and pays its difference, r_t = R(t) - R(t-1), so that the return of an episode is
R(end) - R(start). All agents share the value of the trees; each agent pays A times for its acts, so that the team's
mean is R.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from warp_torchrl.env.reward.base import Reward
from warp_torchrl.env.reward.terms import TERMS
from warp_torchrl.validation import check_fields, did_you_mean
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.front import alignment, block_shares, centre, containment, exposure
from warp_torchrl.world.state.state import Transition, TreeCounts, WorldState


@dataclass(frozen=True, kw_only=True)
class Conservation(Reward):
    """Base class of the five conservation rewards.

    By default each agent pays for its acts and earns the shaping of its potential, at a tenth of the weight, by which a
    team learns sooner. The sum over the team equals that with ``team_share`` 1, and potentials of single agents do not
    change the equilibria (Devlin and Kudenko 2011); but each act costs its agent A times as much as the team's mean.

    Attributes:
        preserved: w_p, weight of each tree untouched by fire or agents [1 / initial tree].
        extinguished: w_e, weight of each tree that was extinguished and stands.
        cleared: w_c, weight of each cleared tree.
        burned: w_b, weight of each tree that burned to ash.
        act: w_a, cost of each extinguish or clear action [``act_per``].
        act_per: ``tree``: c = w_a / N0, an act costs as many trees on any map; ``forest``: c = w_a, an act costs more
            trees on a larger map, and teams that cannot save trees yet learn to do nothing.
    """

    team_share: float = 0.0
    scale: float = 5.0
    shaping: float = 0.1
    preserved: float = 1.0
    extinguished: float = 0.9
    cleared: float = 0.5
    burned: float = 1.0
    act: float = 0.1
    act_per: Literal["tree", "forest"] = "tree"

    def own(self, transition: Transition) -> Tensor:
        """Return each agent's reward before sharing and shaping, float32 [B, A]."""
        before, after = transition.before, transition.after
        gained = self.value(after, transition.counts_after) - self.value(before, transition.counts_before)
        gained = gained + self.bonus(transition)
        acts = after.vehicles.acts - before.vehicles.acts
        return gained[:, None] - self.cost_of_an_act(transition.counts_before.initial[:, None]) * acts.shape[1] * acts

    def cost_of_an_act(self, initial: Tensor) -> Tensor | float:
        """Return c for numbers of initial trees, float32 of the same shape; one number where it is w_a."""
        return self.act / initial if self.act_per == "tree" else self.act

    def worth(self, counts: TreeCounts) -> Tensor:
        """Return Q, float32 [B]."""
        worth = (
            self.preserved * counts.preserved
            + self.extinguished * counts.extinguished
            - self.cleared * counts.cleared
            - self.burned * counts.burned
        )
        return worth / counts.initial

    def value(self, state: WorldState, counts: TreeCounts) -> Tensor:
        """Return R without the cost of acts, float32 [B]."""
        return self.worth(counts)

    def bonus(self, transition: Transition) -> Tensor | float:
        """Return a step's reward that is no difference of states, float32 [B]."""
        return 0.0


@dataclass(frozen=True, kw_only=True)
class Efficiency(Conservation):
    """Conservation reward 1: preserve and save trees with few actions.

    R = Q - c A_total      (WARP-CA, eq. of the action efficiency)
    """


@dataclass(frozen=True, kw_only=True)
class Time(Conservation):
    """Conservation reward 2: also save time.

        R = Q - zeta T_total / T_max - c A_total

    The paper prints -zeta / T_total, which rewards slow teams and contradicts its text. ``rule: printed`` pays that
    term once, at the end.

    Attributes:
        zeta: Weight of the time until the episode's end.
        rule: ``share`` of the horizon, or ``printed``.
        horizon: T_max, agent steps; the environment's.
    """

    act: float = 0.0
    zeta: float = 0.2
    rule: Literal["share", "printed"] = "share"
    horizon: int = 256

    def value(self, state: WorldState, counts: TreeCounts) -> Tensor:
        """Return R without the cost of acts, float32 [B]."""
        if self.rule == "printed":
            return self.worth(counts)
        return self.worth(counts) - self.zeta / self.horizon * state.step

    def bonus(self, transition: Transition) -> Tensor | float:
        """Return -zeta / T_total at the end of an episode under rule ``printed``, else 0, float32 [B]."""
        if self.rule == "share":
            return 0.0
        return -self.zeta / transition.after.step.clamp(min=1) * transition.after.done


@dataclass(frozen=True, kw_only=True)
class Coverage(Conservation):
    """Conservation reward 3: also protect every block of the map.

        R = Q + sum over blocks of omega a_block [under 5 % of the block's trees burn or have burned] - c A_total

    Attributes:
        omega: Weight of each block.
        side: Side of a block [cells].
        least: Share of lost trees from which a block counts as burned.
    """

    act: float = 0.0
    omega: float = 0.02
    side: int = 8
    least: float = 0.05

    def value(self, state: WorldState, counts: TreeCounts) -> Tensor:
        """Return R without the cost of acts, float32 [B]."""
        lost = state.burned | is_burning(state.cells)
        spared = block_shares(lost, state.initial, self.side) < self.least
        assets = state.landscape.layer("assets")
        if assets is None:
            return self.worth(counts) + self.omega * spared.sum((1, 2))
        worth = avg_pool2d(assets[:, None], self.side, ceil_mode=True, count_include_pad=False)[:, 0]
        worth = worth / worth.mean((1, 2), keepdim=True).clamp(min=1e-6)
        return self.worth(counts) + self.omega * (worth * spared).sum((1, 2))


@dataclass(frozen=True, kw_only=True)
class Collaborative(Conservation):
    """Conservation reward 4: also act together.

        R = eta max(Q, 0) + min(Q, 0) - c A_total,   eta = 1 + bonus x share of agents with a useful act lately

    eta multiplies only positive Q, so that idling never reduces a loss; with ``rule: printed`` it multiplies all of Q.

    Attributes:
        together: Largest bonus in eta.
        window: Steps for which a credited act counts as recent.
        rule: ``positive`` or ``printed``.
    """

    act: float = 0.0
    together: float = 0.5
    window: int = 16
    rule: Literal["positive", "printed"] = "positive"

    def value(self, state: WorldState, counts: TreeCounts) -> Tensor:
        """Return R without the cost of acts, float32 [B]."""
        last = state.vehicles.last_useful
        lately = (last >= 0) & (state.step[:, None] - last <= self.window)
        eta = 1.0 + self.together * lately.to(torch.float32).mean(dim=1)
        worth = self.worth(counts)
        return eta * worth if self.rule == "printed" else eta * worth.clamp(min=0.0) + worth.clamp(max=0.0)


@dataclass(frozen=True, kw_only=True)
class Adaptive(Conservation):
    """Conservation reward 5: also act where the fire spreads.

        R = Q + theta_1 r_1 + theta_2 r_2 + theta_3 r_3 + sum of further theta_i r_i - c A_total

    r_1: trees put out for the first time on the downwind half of the fire, a share of N0. r_2: drop since the start
    in the trees within ``reach`` cells of fire, a share of N0. r_3: share of rays from the fire's centre to the border
    that meet a lake, bare ground, a firebreak or a wet tree; 1 where nothing burns.

    Attributes:
        downwind: theta_1.
        exposed: theta_2.
        contained: theta_3.
        reach: Cells about fire.
        terms: theta_i of further terms by their name in ``TERMS``: ``front``, ``surrounded``, ``head``, or one of your
            own.

    Raises:
        ValueError: If a value is out of its range, or a term is unknown.
    """

    act: float = 0.0
    downwind: float = 0.1
    exposed: float = 0.1
    contained: float = 0.1
    reach: int = 3
    terms: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, terms=(-1e9, 1e9))
        for name in self.terms:
            if name not in TERMS:
                raise ValueError(f"terms must be of {', '.join(TERMS)}, got {name}{did_you_mean(name, TERMS)}")

    def value(self, state: WorldState, counts: TreeCounts) -> Tensor:
        """Return R without r_1 and the cost of acts, float32 [B]."""
        barrier = (state.alpha == 0.0) | state.firebreak | (state.wet > 0)
        shape = self.contained * containment(is_burning(state.cells), barrier) - self.exposed * exposure(
            state, counts, self.reach
        )
        return self.worth(counts) + shape

    def bonus(self, transition: Transition) -> Tensor:
        """Return theta_1 times the trees put out downwind in this step, a share of N0, and the further terms' sum.

        float32 [B].
        """
        before, result = transition.before, transition.result
        width = before.cells.shape[2]
        place = torch.stack((result.target // width, result.target % width), dim=-1)
        downwind = alignment(place, centre(is_burning(before.cells)), before.wind) >= 0.0
        new = ~before.extinguished.flatten(1).gather(1, result.target)
        count = (result.extinguished & downwind & new).sum(dim=1)
        bonus = self.downwind * count / transition.counts_before.initial
        for name, theta in self.terms.items():
            bonus = bonus + theta * TERMS[name](transition)
        return bonus
