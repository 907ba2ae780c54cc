"""Paired evaluation: every policy plays the same worlds, on seeds outside of training."""

import logging
from collections.abc import Sequence
from time import monotonic
from typing import ClassVar, Protocol

import numpy as np
import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torchrl.envs.utils import set_exploration_type

from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.specs import episode_metrics
from warp_torchrl.evaluation.behaviour import Behaviour
from warp_torchrl.evaluation.episode_batch import EpisodeBatch, fits
from warp_torchrl.heuristics import HEURISTICS, idle_action
from warp_torchrl.models import ACTION, ACTION_MASK, memory_apart
from warp_torchrl.runs.policies.trained import MODES, scores
from warp_torchrl.system.finite import check_scores
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.world import World

log = logging.getLogger("warp_torchrl")

BASELINES = ("noop", "random", "local", "greedy", "coordinated")
"""Baselines of every table."""
SEARCHING = ("oldest", "lawnmower", "follower")
"""Those that are there too where agents know what was seen alone."""

_SECONDS = 60.0
"""Between two lines about episodes that take long."""
_CELLS_ABREAST = 2**21
"""Of the worlds of all heuristics that play in one batch; more take much memory, and gain nothing."""

Episodes = dict[str, np.ndarray]
"""Final metrics of n episodes, float64 [n] each."""


class Recorder(Protocol):
    """Recorder of an episode."""

    def add(self, state: WorldState) -> None:
        """Append world 0 of a batch."""
        ...


def baselines_of(world: World) -> tuple[str, ...]:
    """Return the baselines to which a policy is compared in a world."""
    searching = SEARCHING if world.sensing.is_limited else ()
    return (*BASELINES, *searching, *(name for each in world.loop for name in each.baselines))


def play(
    env: WildfireEnv,
    policy: TensorDictModuleBase,
    first_seed: int,
    mode: str = "sampled",
    recorder: Recorder | None = None,
    watch: bool = False,
) -> Episodes:
    """Play one episode in each world of an environment until all have ended.

    ``first_seed`` also seeds the draws of a sampled policy. The global generator and a recurrent policy's hidden state
    are restored.

    Args:
        env: Its worlds start episode 0 of the seeds ``first_seed``, ``first_seed + 1``, ...
        policy: Any policy.
        first_seed: Seed of world 0.
        mode: ``sampled`` or ``deterministic``.
        recorder: Records world 0 after every step.
        watch: Whether to add the measures of ``BEHAVIOUR``.

    Returns:
        The metrics of each world.

    Raises:
        NumericalFailure: If what the policy chooses by is not finite.
    """
    with torch.random.fork_rng(), torch.no_grad(), set_exploration_type(MODES[mode]), memory_apart(policy):
        torch.manual_seed(first_seed)
        env.set_seed(first_seed, static_seed=True)
        now = env.reset()
        behaviour = Behaviour(env.shared_state) if watch else None
        plays = _steps if recorder is not None or not fits(env, policy) else _match
        found = plays(env, policy, now, recorder, behaviour)
    episodes = {name: found[name].double().cpu().numpy() for name in episode_metrics(env.world)}
    return episodes if behaviour is None else episodes | behaviour.summary()


def _match(
    env: WildfireEnv,
    policy: TensorDictModuleBase,
    now: TensorDictBase,
    recorder: Recorder | None,
    behaviour: Behaviour | None,
) -> dict[str, Tensor]:
    match = EpisodeBatch(env, [policy], behaviour)
    found = match.play(now)
    env.set_state(match.ended)
    return found


def _steps(
    env: WildfireEnv,
    policy: TensorDictModuleBase,
    now: TensorDictBase,
    recorder: Recorder | None,
    behaviour: Behaviour | None,
) -> dict[str, Tensor]:
    """Play step by step, for any policy, and return the metrics [B]."""
    watcher = env.watcher
    env.watcher = watcher if behaviour is None else behaviour
    told = monotonic()
    for step in range(1, env.world.horizon + 1):
        if recorder is not None:
            recorder.add(env.shared_state)
        acted = policy(now)
        check_scores(scores(acted))  # here each step reads from the device anyway
        now = env.step(acted)["next"]
        ended = int(now["done"].sum())
        if ended == len(now["done"]):
            break
        if monotonic() - told > _SECONDS:
            log.info("step %d of %d at most: %d of %d episodes have ended", step, env.world.horizon, ended, len(now))
            told = monotonic()
    if recorder is not None:
        recorder.add(env.shared_state)
    env.watcher = None
    return {name: now["info", name][:, 0] for name in episode_metrics(env.world)}


class WithoutAgent(TensorDictModuleBase):
    """A policy without one agent, which takes an action without effect at every step.

    Args:
        policy: Policy of the whole team.
        agent: Index of the agent.
        team: The team.
    """

    out_keys: ClassVar = [ACTION]

    def __init__(self, policy: TensorDictModuleBase, agent: int, team: Team) -> None:
        super().__init__()
        self.policy, self.agent, self.team = policy, agent, team
        self.in_keys = [*policy.in_keys, ACTION_MASK]

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the team's actions, int64 [B, A]."""
        out = self.policy(tensordict)
        mask = tensordict.get(ACTION_MASK)[:, self.agent]
        idle = idle_action(mask, self.team)
        action = out.get(ACTION).clone()
        action[:, self.agent] = idle
        return out.set(ACTION, action)


def play_heuristics(env: WildfireEnv, first_seed: int, names: Sequence[str] = BASELINES) -> dict[str, Episodes]:
    """Return the episodes of heuristics by name."""
    cells = env.batch_size[0] * env.world.size[0] * env.world.size[1]
    abreast = [name for name in names if fits(env, HEURISTICS[name](env))]
    abreast = abreast if cells * len(abreast) <= _CELLS_ABREAST else []
    found = play_abreast(env, first_seed, abreast) if abreast else {}
    found |= {name: play(env, HEURISTICS[name](env), first_seed) for name in names if name not in found}
    return {name: found[name] for name in names}


def play_abreast(env: WildfireEnv, first_seed: int, names: Sequence[str]) -> dict[str, Episodes]:
    """Return the episodes of heuristics by name, all played in one batch: a step of few worlds costs what many do."""
    count = env.batch_size[0]
    wide = WildfireEnv(
        env.world,
        observation=env.observation,
        reward=env.reward_function,
        n_worlds=count * len(names),
        seeds=[*range(first_seed, first_seed + count)] * len(names),
        device=env.device,
    )
    with torch.random.fork_rng(), torch.no_grad():
        start = wide.reset()
        ends = EpisodeBatch(wide, [HEURISTICS[name](wide) for name in names]).play(start)
    numbers = {
        metric: ends[metric].double().cpu().numpy().reshape(len(names), count) for metric in episode_metrics(env.world)
    }
    return {name: {metric: rows[at] for metric, rows in numbers.items()} for at, name in enumerate(names)}
