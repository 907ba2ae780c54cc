"""Who labels what a team visits: a heuristic, or a trained policy, which sees the worlds as it was trained to."""

from collections.abc import Mapping
from typing import Any

from tensordict import TensorDictBase
from torch import Tensor, no_grad
from torchrl.envs.utils import set_exploration_type

from warp_torchrl.config.construction import ConfigError, build
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.models import ACTION, ACTION_MASK, AGENCY, OBSERVATION, ROLE, recurrent_actors
from warp_torchrl.named_policy import NamedPolicy, fitted_policy
from warp_torchrl.observation import Observation
from warp_torchrl.policy import MODES


class HeuristicTeacher:
    """A heuristic that tells what it would do.

    Args:
        name: One of ``TEACHERS``.
        env: The training environment, whose worlds it reads.
    """

    def __init__(self, name: str, env: WildfireEnv) -> None:
        self._heuristic = HEURISTICS[name](env)

    def actions(self, shown: TensorDictBase) -> Tensor:
        """Return what it would do, int64 [B, A]."""
        return self._heuristic(shown.select(ACTION_MASK)).get(ACTION)


class TrainedTeacher:
    """A trained policy that tells what it would do, in its own mode, of worlds that it sees as it was trained to.

    Args:
        named: The policy.
        env: The training environment, whose worlds it looks at.

    Raises:
        ConfigError: If it does not fit the worlds, or remembers or talks, so that it cannot judge a state by itself.
    """

    def __init__(self, named: NamedPolicy, env: WildfireEnv) -> None:
        found = named.checkpoint
        if found is None:
            raise ConfigError(f"imitation.teacher must be a trained policy, got {named.name}")
        self._env, self._digest = env, found.manifest.files["policy.pt"]["sha256"]
        self._observation: Observation = build(named.config(())["observation"], "observation")
        worlds = WildfireEnv(env.world, observation=self._observation, n_worlds=1, device=env.device)
        self._policy = fitted_policy(found, worlds, named.name).to(env.device)
        if self._policy.talks or recurrent_actors(self._policy):
            raise ConfigError(f"imitation.teacher must neither remember nor talk, and {named.name} does")

    def actions(self, shown: TensorDictBase) -> Tensor:
        """Return what it would do, int64 [B, A]."""
        state, world = self._env.world_state, self._env.world
        with no_grad(), set_exploration_type(MODES[self._policy.mode]):
            seen = self._observation(state, world, world.forecast(state))
            given = shown.select(ACTION_MASK, ROLE, AGENCY, strict=False)
            for name, value in seen.items():
                given.set((*OBSERVATION, name) if name else OBSERVATION, value)
            return self._policy(given).get(ACTION)

    def state_dict(self) -> dict[str, Any]:
        """Return what tells it from another."""
        return {"digest": self._digest}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Check that it is who taught before.

        Raises:
            ConfigError: If it is not.
        """
        if state["digest"] != self._digest:
            raise ConfigError("imitation.teacher has other weights than when this run began: give it the former")


Teacher = HeuristicTeacher | TrainedTeacher


def teacher(name: str, env: WildfireEnv) -> Teacher:
    """Return who teaches, by name: a heuristic, a shipped policy, a run folder or a checkpoint.

    Raises:
        ConfigError: See ``TrainedTeacher``.
        CheckpointError: If a folder holds no sound checkpoint.
    """
    return HeuristicTeacher(name, env) if name in HEURISTICS else TrainedTeacher(NamedPolicy(name), env)
