"""A reward for what initial attack is for: worth that is left, and fires that stay small."""

from dataclasses import dataclass

from torch import Tensor

from warp_torchrl.env.reward.base import Reward
from warp_torchrl.validation import check_fields
from warp_torchrl.world.state.state import Transition, WorldState
from warp_torchrl.world.world import World


@dataclass(frozen=True, kw_only=True)
class Worth(Reward):
    """Pays for the worth that fire leaves, and for fires that do not grow to the size at which they escape.

        R = w_v V - w_s min(1, S / S_e)

    V is the metric ``worth_saved``, S ``fire_size`` and S_e the mechanic's ``escape_area``; a step earns
    R(t) - R(t-1), so that an episode earns R(end) - R(start). All agents earn the same. A fire costs nothing more once
    it has escaped. The weights are ours.

    Attributes:
        saved: w_v.
        size: w_s.

    Raises:
        ValueError: If a value is out of its range.
    """

    team_share: float = 0.0
    scale: float = 5.0
    shaping: float = 0.1
    saved: float = 1.0
    size: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, saved=(0.0, 1e6), size=(0.0, 1e6))

    def check_world(self, world: World) -> None:
        """Check that the worlds know what is worth something.

        Raises:
            ValueError: If not.
        """
        if "worth_saved" not in world.metric_names:
            raise ValueError("mechanics.values must be there where reward is worth, which pays for what is left")

    def own(self, transition: Transition) -> Tensor:
        """Return each agent's reward before sharing and shaping, float32 [B, A]."""
        gained = self.value(transition.after) - self.value(transition.before)
        return gained[:, None].expand(transition.after.vehicles.acts.shape)

    def value(self, state: WorldState) -> Tensor:
        """Return R, float32 [B]."""
        left, size = (state.plane("values", part) for part in ("left", "size"))
        if left is None or size is None:
            raise ValueError("reward worth needs worlds with values: choose mechanics.values={}")
        return self.saved * left - self.size * size.clamp(max=1.0)
