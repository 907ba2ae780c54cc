"""Reward of the vehicles of several agencies."""

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import one_hot

from warp_torchrl.env.reward.conservation import Conservation
from warp_torchrl.world.state.cells import is_tree
from warp_torchrl.world.state.state import Transition, WorldState
from warp_torchrl.world.state.worth import sums_by, worth_of
from warp_torchrl.world.world import World


@dataclass(frozen=True, kw_only=True)
class Agency(Conservation):
    """Pays each vehicle for the forest of the agency that it serves, and for that of others as far as they cooperate.

        Q_k = (w_p T_p + w_e T_e - w_c T_c - w_b T_b) / N0
        own_i = dQ_k + cooperation x (mean of dQ_j over the other agencies) - c_k A_k a_i

    Q_k is the value of the forest on the land of agency k, each tree by its worth. Vehicle i served agency k in the
    step, A_k vehicles did, a_i is 1 for an act, and c_k is w_a / N0, N0 the worth of k's trees. With ``cooperation`` 1
    two agencies earn the same, the sum of both. With 0 each is for itself. With -1 what one gains the other loses: a
    zero-sum game but for acts and shaping.

    Attributes:
        cooperation: Weight of the other agencies' forest.

    Raises:
        ValueError: If a value is out of its range.
    """

    cooperation: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not -1.0 <= self.cooperation <= 1.0:
            raise ValueError(f"cooperation must be in [-1, 1], got {self.cooperation}")
        if self.team_share != 0.0:
            raise ValueError(
                f"team_share must be 0 in reward=agency, where cooperation says what is shared, got {self.team_share}"
            )

    def check_world(self, world: World) -> None:
        """Check that the world has agencies.

        Raises:
            ValueError: If it has but one.
        """
        if not world.agencies.names:
            raise ValueError("agencies must be several where reward is agency, got one")

    def own(self, transition: Transition) -> Tensor:
        """Return each vehicle's reward before shaping, float32 [B, A]."""
        before, after = transition.before, transition.after
        worth, serves = _plane(before, "worth"), _plane(before, "serves")
        agencies = worth.shape[1]
        gained = self.worth_by_agency(after) - self.worth_by_agency(before)
        others = (gained.sum(dim=1, keepdim=True) - gained) / (agencies - 1)
        earned = gained + self.cooperation * others
        vehicles = one_hot(serves, agencies).sum(dim=1)
        acts = after.vehicles.acts - before.vehicles.acts
        cost = self.cost_of_an_act(torch.where(worth > 0.0, worth, torch.inf).gather(1, serves))
        return earned.gather(1, serves) - cost * vehicles.gather(1, serves) * acts

    def worth_by_agency(self, state: WorldState) -> Tensor:
        """Return Q_k, float32 [B, K]; 0 where an agency has no tree."""
        owner, worth = _plane(state, "owner"), _plane(state, "worth")
        standing = state.initial & ~state.burned & is_tree(state.cells)
        gain = torch.where(state.extinguished, self.extinguished, self.preserved) * standing
        loss = torch.where(state.burned, self.burned, torch.where(state.firebreak, self.cleared, 0.0)) * state.initial
        total = sums_by(owner, worth_of(state) * (gain - loss), worth.shape[1])
        return torch.where(worth > 0.0, total / worth, 0.0)


def _plane(state: WorldState, name: str) -> Tensor:
    """Return a plane that several agencies keep.

    Raises:
        ValueError: If there is but one agency.
    """
    found = state.plane("agencies", name)
    if found is None:
        raise ValueError("reward agency needs worlds of several agencies: choose agencies=several")
    return found
