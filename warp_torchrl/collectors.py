"""How batches are collected."""

from dataclasses import dataclass

from torchrl.collectors import Collector

from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.env import WildfireEnv


@dataclass(frozen=True, kw_only=True)
class Direct:
    """Collects in this process: exact resume.

    Attributes:
        steps: World steps a batch, for each world.

    Raises:
        ValueError: If steps is not in 1..100000.
    """

    steps: int = 64

    def __post_init__(self) -> None:
        if not 1 <= self.steps <= 100_000:
            raise ValueError(f"steps must be in 1..100000, got {self.steps}")

    def open(self, env: WildfireEnv, learner: Learner) -> Collector:
        """Return TorchRL's collector, which resets finished worlds at once."""
        return Collector(
            env,
            learner.explore,
            frames_per_batch=self.steps * env.batch_size[0],
            total_frames=-1,
            return_same_td=True,
            track_traj_ids=False,
            auto_register_policy_transforms=False,
        )
