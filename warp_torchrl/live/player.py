"""Policy of a match, with random draws per player; it loads newer weights while its run is training."""

from pathlib import Path

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torchrl.envs.utils import set_exploration_type

from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.models import ACTION
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.history import trained_steps
from warp_torchrl.runs.policies.named_policy import NamedPolicy, fitted_policy
from warp_torchrl.runs.policies.trained import MODES, TrainedPolicy


class Player:
    """A policy that acts in one world. Its random draws equal those of an evaluation with the same seed.

    Args:
        name: Name that the page shows.
        policy: Acts in an environment of one world.
        mode: ``sampled`` or ``deterministic``.
        seed: Of its draws.
        checkpoint: Checkpoint from which it was loaded; None for a baseline.
    """

    def __init__(
        self,
        name: str,
        policy: TensorDictModuleBase,
        mode: str,
        seed: int,
        checkpoint: checkpoints.Checkpoint | None = None,
    ) -> None:
        self.name, self.policy, self.mode, self.checkpoint = name, policy, mode, checkpoint
        self.restart(seed)

    @property
    def frames(self) -> int | None:
        """Return the world steps of all trainings behind it; None for a baseline."""
        return None if self.checkpoint is None else trained_steps(self.checkpoint.history)

    def restart(self, seed: int) -> None:
        """Restart its random draws."""
        self._draws = torch.Generator().manual_seed(seed).get_state()

    def act(self, shown: TensorDictBase) -> tuple[Tensor, Tensor | None]:
        """Choose the team's actions.

        Args:
            shown: What the environment shows, batch size [1].

        Returns:
            The actions, int64 [A], and each action's probability, float32 [A, actions]; None of a policy that has none.
        """
        with torch.no_grad(), set_exploration_type(MODES[self.mode]), torch.random.fork_rng(devices=[]):
            torch.set_rng_state(self._draws)
            out = self.policy(shown.copy())
            self._draws = torch.get_rng_state()
        return out[ACTION][0], self._probabilities(out)

    def _probabilities(self, acted: TensorDictBase) -> Tensor | None:
        found = self.policy.probabilities(acted) if isinstance(self.policy, TrainedPolicy) else None
        return None if found is None else found[0]

    def follow(self, env: WildfireEnv) -> str | None:
        """Load the newest checkpoint of its run folder.

        Returns:
            A line that says that it has newer weights, or why it keeps the present ones; None if nothing changed.
        """
        if self.checkpoint is None or not _is_run(self.name):
            return None
        try:
            found, _ = checkpoints.newest(self.name)
            if found.manifest.frames <= self.checkpoint.manifest.frames:
                return None
            self.policy = fitted_policy(found, env, self.name)
        except (checkpoints.CheckpointError, ConfigError, OSError) as error:
            return f"{self.name} keeps its weights: {' '.join(str(error).split())}"
        self.checkpoint = found
        return f"{self.name} plays its newest weights, of {self.frames:,} steps"


def player_of(named: NamedPolicy, env: WildfireEnv, seed: int) -> Player:
    """Return a policy as a player in an environment.

    Raises:
        ConfigError: If it does not fit there.
    """
    if named.checkpoint is None:
        return Player(named.name, HEURISTICS[named.name](env), "sampled", seed)
    policy = fitted_policy(named.checkpoint, env, named.name)
    return Player(named.name, policy, policy.mode, seed, named.checkpoint)


def _is_run(name: str) -> bool:
    """Return whether a name is of a folder whose newest checkpoint may change."""
    return (Path(name) / "checkpoints").is_dir()
