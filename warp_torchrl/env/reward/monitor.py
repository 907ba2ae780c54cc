"""A reward for keeping the fire's front in sight."""

from dataclasses import dataclass

from torch import Tensor

from warp_torchrl.env.reward.base import Reward, near_misses
from warp_torchrl.validation import check_fields
from warp_torchrl.world.state.records import KNOWLEDGE
from warp_torchrl.world.state.state import Transition
from warp_torchrl.world.world import World


@dataclass(frozen=True, kw_only=True)
class Monitor(Reward):
    """Pays a team that watches a fire and need not fight it.

        own_i = A (w_w W_i + w_f F_i - w_m M_i) + w_u (U(t-1) - U(t))

    W_i: share of the front, the burning cells that can spread, that the team saw burn at most ``sensing.recent`` steps
    ago, as far as agent i saw it last. F_i: burning cells that nobody of the team knew to burn and that agent i records
    first, a share of all that burn. Agents that saw a cell in the same step share W and F of it. M_i: 1 where aircraft
    i ends the step with a near miss (``mechanics.flight.separation``), else 0. U: mean over the map of 1 - freshness of
    the team's newest records. An agent's own part counts A times, as in other rewards. The team's mean is

        R = sum_i (w_w W_i + w_f F_i - w_m M_i) + w_u (U(t-1) - U(t))

    A fire that is found sooner is watched for longer, and discounted less.

    The task is that of Julian and Kochenderfer, "Distributed wildfire surveillance with autonomous aircraft using deep
    reinforcement learning" (JGCD 42(8), 2019), and of Viseras, Meissner and Marchal, "Wildfire front monitoring with
    multiple UAVs using deep Q-learning" (IEEE Access, 2021). The terms and weights are ours.

    Attributes:
        watched: w_w.
        found: w_f.
        uncertainty: w_u.
        near_miss: w_m; nothing where ``mechanics.flight.separation`` is not set.

    Raises:
        ValueError: If a value is out of its range.
    """

    team_share: float = 0.0
    scale: float = 5.0
    shaping: float = 0.0
    watched: float = 0.02
    found: float = 0.1
    uncertainty: float = 0.5
    near_miss: float = 0.005

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, watched=(0.0, 1e6), found=(0.0, 1e6), uncertainty=(0.0, 1e6), near_miss=(0.0, 1e6))

    def check_world(self, world: World) -> None:
        """Check that the worlds keep what the team watches: that the sight of the agents is limited.

        Raises:
            ValueError: If it is not.
        """
        if "watched" not in world.metric_names:
            raise ValueError("sensing must be sight where reward is monitor, which pays for what was seen, got full")

    def own(self, transition: Transition) -> Tensor:
        """Return each agent's reward before sharing and shaping, float32 [B, A]."""
        before, after = transition.before, transition.after
        watches, finds, uncertain = (after.plane(KNOWLEDGE, part) for part in ("watches", "finds", "uncertain"))
        was = before.plane(KNOWLEDGE, "uncertain")
        if watches is None or finds is None or uncertain is None or was is None:
            raise ValueError("reward monitor needs worlds whose agents' sight is limited: choose sensing=sight")
        own = self.watched * watches + self.found * finds
        own = own - self.near_miss * near_misses(transition)
        return own.shape[1] * own + self.uncertainty * (was - uncertain)[:, None]
