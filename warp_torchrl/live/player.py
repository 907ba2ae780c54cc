"""A policy as a match plays it: found by name, acting with its own draws, and newer where its run goes on training."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torchrl.envs.utils import set_exploration_type

from warp_torchrl.api import policy_of
from warp_torchrl.config.compose import compose_config, plain
from warp_torchrl.config.construction import ConfigError
from warp_torchrl.config.saved_config import restore
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.models import ACTION
from warp_torchrl.nearest import did_you_mean
from warp_torchrl.policy import MODES, TrainedPolicy
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.shipped import find_policy, policy_names


class Found:
    """What a policy's name stands for: a baseline, or a verified checkpoint.

    Args:
        name: A baseline, a shipped policy, a run folder or a checkpoint folder.

    Raises:
        ConfigError: If a single word is none of them.
        CheckpointError: If a folder holds no sound checkpoint.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.checkpoint: checkpoints.Checkpoint | None = None
        if name in HEURISTICS:
            return
        if len(Path(name).parts) == 1 and not Path(name).exists() and name not in policy_names():
            names = [*HEURISTICS, *policy_names()]
            raise ConfigError(
                f"policy must be one of {', '.join(names)}, or a run folder, got {name}{did_you_mean(name, names)}"
            )
        self.checkpoint, _ = checkpoints.newest(find_policy(name))

    def config(self, overrides: Sequence[str]) -> dict[str, Any]:
        """Return the configuration that it plays in: of a checkpoint that of its training, under the overrides.

        Raises:
            ConfigError: If an override does not fit, in one line.
        """
        if self.checkpoint is None:
            return plain(compose_config("train", overrides))
        return plain(restore(self.checkpoint.record(), overrides))

    def player(self, env: WildfireEnv, seed: int) -> "Player":
        """Return the policy in an environment.

        Raises:
            ConfigError: If it does not fit there.
        """
        if self.checkpoint is None:
            return Player(self.name, HEURISTICS[self.name](env), "sampled", seed)
        policy = _fitted(self.checkpoint, env, self.name)
        return Player(self.name, policy, policy.mode, seed, self.checkpoint)


class Player:
    """A policy that acts in one world, with draws of its own: those that an evaluation of the same seed has.

    Args:
        name: What people call it.
        policy: Acts in an environment of one world.
        mode: ``sampled`` or ``deterministic``.
        seed: Of its draws.
        checkpoint: Of which it was loaded; None for a baseline.
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
        """Return the world steps that it was trained for; None for a baseline."""
        return None if self.checkpoint is None else self.checkpoint.manifest.frames

    def restart(self, seed: int) -> None:
        """Begin its draws anew."""
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
        """Go on with the newest checkpoint of its run folder.

        Returns:
            What there is to tell: that it has newer weights, or why it keeps those that it has; None if nothing.
        """
        if self.checkpoint is None or not _is_run(self.name):
            return None
        try:
            found, _ = checkpoints.newest(self.name)
            if found.manifest.frames <= self.checkpoint.manifest.frames:
                return None
            self.policy = _fitted(found, env, self.name)
        except (checkpoints.CheckpointError, ConfigError, OSError) as error:
            return f"{self.name} keeps its weights: {' '.join(str(error).split())}"
        self.checkpoint = found
        return f"{self.name} plays its newest weights, of {found.manifest.frames:,} steps"


def _fitted(found: checkpoints.Checkpoint, env: WildfireEnv, name: str) -> TrainedPolicy:
    try:
        return policy_of(found).fitted(env)
    except checkpoints.CheckpointError:
        raise
    except ValueError as error:
        raise ConfigError(f"the policy {name} does not fit here: {error}") from None


def _is_run(name: str) -> bool:
    """Return whether a name is of a folder whose newest checkpoint may change."""
    return (Path(name) / "checkpoints").is_dir()
