"""A reward for a belief that fits the fire."""

from dataclasses import dataclass

from torch import Tensor

from warp_torchrl.env.reward.base import Reward, near_misses
from warp_torchrl.validation import check_fields
from warp_torchrl.world.state.state import Transition
from warp_torchrl.world.world import World


@dataclass(frozen=True, kw_only=True)
class Brier(Reward):
    """Pays a team for less uncertainty: for how well what it believes fits the fire.

        own_i = w_s S(t) - A w_m M_i,   S = 1 - sum (p - y)^2 / sum y^2

    p: share of the members of the belief in which a cell burns. y: 1 where it does. S: Brier skill score against the
    belief that nothing burns (Brier 1950), mean over a world's beliefs. Of a calibrated belief the error of a cell is
    p (1 - p), the variance of the members: what is seen is certain, and a fire that nobody knows of is an error of 1.
    The score is proper: no belief earns more than the chances that the team should assign. M_i: as in ``Monitor``, 1
    where aircraft i ends the step with a near miss. The terms and weights are ours.

    Attributes:
        skill: w_s.
        near_miss: w_m; nothing where ``mechanics.flight.separation`` is not set.

    Raises:
        ValueError: If a value is out of its range.
    """

    scale: float = 5.0
    shaping: float = 0.0
    skill: float = 0.02
    near_miss: float = 0.005

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, skill=(0.0, 1e6), near_miss=(0.0, 1e6))

    def check_world(self, world: World) -> None:
        """Check that the worlds have beliefs.

        Raises:
            ValueError: If not.
        """
        if "skill" not in world.metric_names:
            raise ValueError("belief must be ensemble where reward is brier, which pays for what is believed, got none")

    def own(self, transition: Transition) -> Tensor:
        """Return each agent's reward before sharing and shaping, float32 [B, A]."""
        skill = transition.after.plane("belief", "skill")
        if skill is None:
            raise ValueError("reward brier needs worlds with beliefs: choose belief=ensemble")
        misses = near_misses(transition)
        return self.skill * skill[:, None] - misses.shape[1] * self.near_miss * misses
