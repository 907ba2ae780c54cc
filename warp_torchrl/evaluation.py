"""Paired evaluation of any policy: every policy meets the same worlds, on seeds that training never sees."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from tensordict.nn import TensorDictModuleBase
from torchrl.envs.utils import ExplorationType, set_exploration_type

from warp_torchrl.env import EPISODE_METRICS, WildfireEnv
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.render import EpisodeRecorder

MODES = {"sampled": ExplorationType.RANDOM, "deterministic": ExplorationType.DETERMINISTIC}
RESAMPLES = 4000
YARDSTICKS = ("noop", "random", "local", "greedy", "coordinated")
"""Policies that every table shows."""

Episodes = dict[str, np.ndarray]
"""Each metric at the end of each episode, float64 [n]."""


def play(
    env: WildfireEnv,
    policy: TensorDictModuleBase,
    first_seed: int,
    mode: str = "sampled",
    recorder: EpisodeRecorder | None = None,
) -> Episodes:
    """Play one episode in each world of an environment, without resets, until all have ended.

    The draws of a sampled policy are seeded by ``first_seed``; the global generator is left as it was.

    Args:
        env: Its worlds become episode 0 of ``first_seed``, ``first_seed + 1``, ...
        policy: Any policy.
        first_seed: Seed of world 0.
        mode: ``sampled`` or ``deterministic``.
        recorder: Is shown world 0 after every step.

    Returns:
        The metrics of each world.
    """
    with torch.random.fork_rng(), torch.no_grad(), set_exploration_type(MODES[mode]):
        torch.manual_seed(first_seed)
        env.set_seed(first_seed, static_seed=True)
        now = env.reset()
        for _ in range(env.world.horizon):
            if recorder is not None:
                recorder.add(env.world_state)
            now = env.step(policy(now))["next"]
            if now["done"].all():
                break
        if recorder is not None:
            recorder.add(env.world_state)
    return {name: now["info", name][:, 0].double().cpu().numpy() for name in EPISODE_METRICS}


def interquartile_mean(values: np.ndarray) -> np.ndarray:
    """Return the mean of the middle half along the last axis (Agarwal et al. 2021, as ``scipy.stats.trim_mean``)."""
    ordered = np.sort(values, axis=-1)
    cut = values.shape[-1] // 4
    return ordered[..., cut : values.shape[-1] - cut].mean(axis=-1)


def _resampled(values: np.ndarray) -> np.ndarray:
    """Return bootstrap samples [RESAMPLES, n], the same worlds for every policy and metric."""
    draws = np.random.default_rng(0).integers(len(values), size=(RESAMPLES, len(values)))
    return values[draws]


def _interval(samples: np.ndarray) -> list[float]:
    return [float(bound) for bound in np.percentile(samples, (2.5, 97.5))]


def summarise(episodes: Episodes) -> dict[str, dict[str, Any]]:
    """Return each metric's interquartile mean, mean, and the mean's 95 % bootstrap interval over worlds."""
    return {
        name: {
            "iqm": float(interquartile_mean(values)),
            "mean": float(values.mean()),
            "ci95": _interval(_resampled(values).mean(axis=1)),
            "iqm_ci95": _interval(interquartile_mean(_resampled(values))),
        }
        for name, values in episodes.items()
    }


def compare(episodes: Episodes, other: Episodes) -> dict[str, Any]:
    """Return the mean difference in trees saved, paired by world, with its 95 % bootstrap interval."""
    difference = episodes["saved"] - other["saved"]
    return {"saved_difference": float(difference.mean()), "ci95": _interval(_resampled(difference).mean(axis=1))}


def report(
    scenario: str,
    policy: str,
    first_seed: int,
    episodes: Episodes,
    others: Mapping[str, Episodes],
    other_modes: Mapping[str, Episodes] | None = None,
) -> dict[str, Any]:
    """Return the content of ``evaluation.json``.

    Args:
        scenario: Its name.
        policy: Name of the policy, with its mode.
        first_seed: Seed of world 0.
        episodes: The policy's.
        others: The heuristics' on the same worlds, by name.
        other_modes: The same policy's, acting in another mode, by name.
    """
    count = len(episodes["saved"])
    seeds = list(range(first_seed, first_seed + count))
    rows = [
        {"seed": seed, **{name: float(values[index]) for name, values in episodes.items()}}
        for index, seed in enumerate(seeds)
    ]
    return {
        "scenario": scenario,
        "policy": policy,
        "seeds": seeds,
        "metrics": summarise(episodes),
        "episodes": rows,
        "versus": {name: compare(episodes, other) for name, other in others.items()},
        "yardsticks": {name: summarise(other) for name, other in others.items()},
        "other_modes": {name: summarise(other) for name, other in (other_modes or {}).items()},
    }


def table(content: Mapping[str, Any]) -> str:
    """Return the report as a table for the terminal."""
    header = (
        f"{'policy':<22}{'saved %':>8}{'95 % interval':>16}{'iqm %':>8}{'success %':>11}{'control':>9}{'cleared %':>11}"
    )
    lines = [f"{content['scenario']}: {len(content['seeds'])} fires, seeds from {content['seeds'][0]}", header]
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
            f"{low:+.1f} .. {high:+.1f}"
        )
    return "\n".join(lines)


def play_heuristics(env: WildfireEnv, first_seed: int, names: Sequence[str] = YARDSTICKS) -> dict[str, Episodes]:
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
    draft = path.with_name(f".{path.name}.tmp")
    draft.write_text(json.dumps(content, indent=1), encoding="utf-8")
    draft.replace(path)
