"""Paired evaluation of any policy: every policy meets the same worlds, on seeds that training never sees."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from warp_torchrl import disk
from warp_torchrl.behaviour import BEHAVIOUR, Behaviour
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS, idle_action
from warp_torchrl.models import ACTION, ACTION_MASK, memory_apart
from warp_torchrl.render import EpisodeRecorder
from warp_torchrl.specs import EPISODE_METRICS
from warp_torchrl.statistics import compare, summarise

SHOWN = ("averted", *BEHAVIOUR)
MODES = {"sampled": ExplorationType.RANDOM, "deterministic": ExplorationType.DETERMINISTIC}
BASELINES = ("noop", "random", "local", "greedy", "coordinated")
"""Policies that every table shows."""

Episodes = dict[str, np.ndarray]
"""Each metric at the end of each episode, float64 [n]."""


def play(
    env: WildfireEnv,
    policy: TensorDictModuleBase,
    first_seed: int,
    mode: str = "sampled",
    recorder: EpisodeRecorder | None = None,
    watch: bool = False,
) -> Episodes:
    """Play one episode in each world of an environment, without resets, until all have ended.

    The draws of a sampled policy are seeded by ``first_seed``; the global generator is left as it was, and so is what
    a policy remembers.

    Args:
        env: Its worlds become episode 0 of ``first_seed``, ``first_seed + 1``, ...
        policy: Any policy.
        first_seed: Seed of world 0.
        mode: ``sampled`` or ``deterministic``.
        recorder: Is shown world 0 after every step.
        watch: Whether to add the numbers of ``BEHAVIOUR``.

    Returns:
        The metrics of each world.
    """
    behaviour = None
    with torch.random.fork_rng(), torch.no_grad(), set_exploration_type(MODES[mode]), memory_apart(policy):
        torch.manual_seed(first_seed)
        env.set_seed(first_seed, static_seed=True)
        now = env.reset()
        if watch:
            behaviour = env.watcher = Behaviour(env.world_state)
        for _ in range(env.world.horizon):
            if recorder is not None:
                recorder.add(env.world_state)
            now = env.step(policy(now))["next"]
            if now["done"].all():
                break
        if recorder is not None:
            recorder.add(env.world_state)
    env.watcher = None
    episodes = {name: now["info", name][:, 0].double().cpu().numpy() for name in EPISODE_METRICS}
    return episodes if behaviour is None else episodes | behaviour.summary()


class LeftOut(TensorDictModuleBase):
    """A policy whose team lacks one agent: that one stays where it is, or, where it cannot, does nothing.

    Args:
        policy: The whole team's.
        agent: Index of the one left out.
    """

    in_keys: ClassVar = [ACTION_MASK]
    out_keys: ClassVar = [ACTION]

    def __init__(self, policy: TensorDictModuleBase, agent: int) -> None:
        super().__init__()
        self.policy, self.agent = policy, agent

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the team's actions, int64 [B, A]."""
        out = self.policy(tensordict)
        mask = tensordict.get(ACTION_MASK)[:, self.agent]
        idle = idle_action(mask)
        action = out.get(ACTION).clone()
        action[:, self.agent] = idle
        return out.set(ACTION, action)


def report(
    scenario: str,
    policy: str,
    first_seed: int,
    episodes: Episodes,
    others: Mapping[str, Episodes],
    other_modes: Mapping[str, Episodes] | None = None,
    left_out: Mapping[str, Episodes] | None = None,
    method: str | None = None,
    configuration: str = "",
    world_overrides: Sequence[str] = (),
    frames: int | None = None,
) -> dict[str, Any]:
    """Return the content of ``evaluation.json``.

    Args:
        scenario: Its name.
        policy: Name of the policy, with its mode.
        first_seed: Seed of world 0.
        episodes: The policy's.
        others: The heuristics' on the same worlds, by name.
        other_modes: The same policy's, acting in another mode, by name.
        left_out: The same policy's with an agent left out, by the agent's name.
        method: What the policy is called beside others; its name where None.
        configuration: Tells policies of one method that were trained differently apart.
        world_overrides: How the worlds differ from the scenario's, as overrides.
        frames: World steps that the policy was trained for; None where it was not.
    """
    if "noop" in others:
        episodes = episodes | {"averted": episodes["saved"] - others["noop"]["saved"]}
    count = len(episodes["saved"])
    seeds = list(range(first_seed, first_seed + count))
    rows = [
        {"seed": seed, **{name: _number(values[index]) for name, values in episodes.items()}}
        for index, seed in enumerate(seeds)
    ]
    return {
        "scenario": scenario,
        "world_overrides": list(world_overrides),
        "policy": policy,
        "method": policy if method is None else method,
        "configuration": configuration,
        "frames": frames,
        "seeds": seeds,
        "metrics": _summaries(episodes),
        "episodes": rows,
        "versus": {name: compare(episodes["saved"], other["saved"]) for name, other in others.items()},
        "yardsticks": {name: _summaries(other) for name, other in others.items()},
        "yardstick_episodes": {
            name: {metric: other[metric].tolist() for metric in ("saved", "success")} for name, other in others.items()
        },
        "other_modes": {name: _summaries(other) for name, other in (other_modes or {}).items()},
        "left_out": {agent: compare(episodes["saved"], other["saved"]) for agent, other in (left_out or {}).items()},
    }


def _summaries(episodes: Episodes) -> dict[str, dict[str, Any]]:
    return {name: summarise(values) for name, values in episodes.items()}


def _number(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def table(content: Mapping[str, Any]) -> str:
    """Return the report as a table for the terminal."""
    header = (
        f"{'policy':<22}{'saved %':>8}{'95 % interval':>16}{'iqm %':>8}{'success %':>11}{'control':>9}{'cleared %':>11}"
    )
    lines = [f"{place(content)}: {len(content['seeds'])} fires, seeds from {content['seeds'][0]}", header]
    rows = {**content["yardsticks"], **content["other_modes"], content["policy"]: content["metrics"]}
    for name, summary in rows.items():
        saved = summary["saved"]
        interval = "{:.1f} .. {:.1f}".format(*(100.0 * bound for bound in saved["ci95"]))
        lines.append(
            f"{name:<22}{100 * saved['mean']:>8.1f}{interval:>16}{100 * saved['iqm']:>8.1f}"
            f"{100 * summary['success']['mean']:>11.1f}{summary['control_time']['mean']:>9.2f}"
            f"{100 * summary['cleared']['mean']:>11.2f}"
        )
    for name, difference in content["versus"].items():
        low, high = (100.0 * bound for bound in difference["ci95"])
        lines.append(
            f"{content['policy']} - {name}: {100 * difference['saved_difference']:+.1f} points saved, "
            f"{low:+.1f} .. {high:+.1f}; more on {100 * difference['probability_of_improvement']:.0f} % of fires"
        )
    lines += _behaviour_lines(content)
    return "\n".join(lines)


def place(content: Mapping[str, Any]) -> str:
    """Return what the worlds of a report are called: their scenario, and how they differ from it."""
    return " ".join((content["scenario"], *content.get("world_overrides", ())))


def _behaviour_lines(content: Mapping[str, Any]) -> list[str]:
    lines = []
    for name in SHOWN:
        found = content["metrics"].get(name, {"mean": None})
        if found["mean"] is not None:
            low, high = found["ci95"]
            lines.append(f"{name.replace('_', ' '):<22}{found['mean']:>8.3f}{f'{low:.3f} .. {high:.3f}':>18}")
    for agent, loss in content["left_out"].items():
        low, high = (100.0 * bound for bound in loss["ci95"])
        lines.append(f"without {agent:<14}{-100 * loss['saved_difference']:>+8.1f}{f'{-high:+.1f} .. {-low:+.1f}':>16}")
    return lines


def play_heuristics(env: WildfireEnv, first_seed: int, names: Sequence[str] = BASELINES) -> dict[str, Episodes]:
    """Return the episodes of heuristics by name."""
    return {name: play(env, HEURISTICS[name](env), first_seed) for name in names}


def record_episode(
    path: Path, env: WildfireEnv, policy: TensorDictModuleBase, title: str, seed: int, mode: str
) -> None:
    """Draw one episode, of an environment with one world, as a GIF."""
    recorder = EpisodeRecorder(title=title, roles=env.world.team.agent_roles)
    play(env, policy, seed, mode, recorder)
    recorder.save(path)


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a file whole or not at all."""
    disk.replace(path, json.dumps(content, indent=1))
