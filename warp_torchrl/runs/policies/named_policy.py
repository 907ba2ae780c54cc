"""A policy by its name in a command: a baseline, a shipped policy, a run folder or a checkpoint."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import restore
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.runs.policies.load import policy_of
from warp_torchrl.runs.policies.trained import TrainedPolicy
from warp_torchrl.system.shipped import policy_names
from warp_torchrl.validation import did_you_mean


class NamedPolicy:
    """The policy of a name: a baseline, or a verified checkpoint.

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
        """Return the configuration in which it plays: for a checkpoint that of its training, under the overrides.

        Raises:
            ConfigError: If an override does not fit, in one line.
        """
        if self.checkpoint is None:
            values = plain(compose_config("train", overrides))
        else:
            values = plain(restore(self.checkpoint.saved_config(), overrides))
        run_config(values)  # so that every key is checked, whoever reads it
        return values


def fitted_policy(found: checkpoints.Checkpoint, env: WildfireEnv, name: str) -> TrainedPolicy:
    """Return the policy of a checkpoint, adapted to an environment.

    Args:
        found: The checkpoint.
        env: Where it acts.
        name: What the policy is called.

    Raises:
        ConfigError: If it does not fit there.
        CheckpointError: If its weights are of another architecture.
    """
    try:
        return policy_of(found).fitted(env)
    except checkpoints.CheckpointError:
        raise
    except ValueError as error:
        raise ConfigError(f"the policy {name} does not fit here: {error}") from None
