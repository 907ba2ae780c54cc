"""Teachers: heuristics, or trained policies with the observation of their own training."""

from collections.abc import Mapping
from typing import Any

from tensordict import TensorDictBase
from torch import no_grad
from torchrl.envs.utils import set_exploration_type

from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.observation import Observation
from warp_torchrl.heuristics import HEURISTICS, Heuristic
from warp_torchrl.heuristics.heuristic import instructor
from warp_torchrl.models import ACTION_MASK, AGENCY, OBSERVATION, ROLE, recurrent_actors
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.checkpoint import Checkpoint
from warp_torchrl.runs.config.construction import ConfigError, build
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import restore
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.runs.policies.named_policy import fitted_policy
from warp_torchrl.runs.policies.trained import MODES


class TrainedTeacher:
    """A trained policy that labels worlds with its actions, in its mode and with the observation of its training.

    Args:
        found: Checkpoint.
        name: Name in the configuration.
        env: The training environment.

    Raises:
        ConfigError: If it does not fit the worlds, or remembers or talks, so that it cannot judge a state by itself.
    """

    in_keys = (ACTION_MASK, ROLE, AGENCY)

    def __init__(self, found: Checkpoint, name: str, env: WildfireEnv) -> None:
        self._env, self._digest = env, found.manifest.files[found.weights]["sha256"]
        self._observation: Observation = build(plain(restore(found.saved_config()))["observation"], "observation")
        worlds = WildfireEnv(env.world, observation=self._observation, n_worlds=1, device=env.device)
        self._policy = fitted_policy(found, worlds, name).to(env.device)
        if self._policy.talks or recurrent_actors(self._policy):
            raise ConfigError(f"imitation.teacher must neither remember nor talk, and {name} does")

    def __call__(self, shown: TensorDictBase) -> TensorDictBase:
        """Write the team's actions, int64 [B, A], as a heuristic does."""
        state, world = self._env.shared_state, self._env.world
        with no_grad(), set_exploration_type(MODES[self._policy.mode]):
            for name, value in self._observation(state, world, world.forecast(state)).items():
                shown.set((*OBSERVATION, name) if name else OBSERVATION, value)
            return self._policy(shown)

    def state_dict(self) -> dict[str, Any]:
        """Return the digest of its weights."""
        return {"digest": self._digest}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Check that it has the weights of the teacher before.

        Raises:
            ConfigError: If it is not.
        """
        if state["digest"] != self._digest:
            raise ConfigError("imitation.teacher has other weights than when this run began: give it the former")


def teacher(name: str, env: WildfireEnv, privileged: bool = True) -> Heuristic | TrainedTeacher:
    """Return the teacher of a name: a heuristic, a shipped policy, a run folder or a checkpoint.

    Args:
        name: Name.
        env: The training environment.
        privileged: Whether a heuristic sees the true worlds where sight is limited.

    Raises:
        ConfigError: See ``TrainedTeacher``.
        CheckpointError: If a folder holds no sound checkpoint.
    """
    if name in HEURISTICS:
        return instructor(HEURISTICS[name], env, privileged)
    found, _ = checkpoints.newest(find_policy(name))
    return TrainedTeacher(found, name, env)
