"""Calibration of scenarios by the baselines, and ranking of the baselines by each reward."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
import torch

from warp_torchrl.api.make import make_env
from warp_torchrl.benchmark.timing import clock
from warp_torchrl.env.reward import Adaptive, Collaborative, Coverage, Efficiency, Paper, Reward, Time
from warp_torchrl.evaluation.play import BASELINES, play, play_heuristics
from warp_torchrl.evaluation.statistics import compare, summarise
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.world.state.state import Transition

SCENARIOS = (
    "skirmish",
    "single",
    "default",
    "large",
    "water",
    "hetero",
    "hazard",
    "shift",
    "ring",
    "lightning",
    "paper_sarl",
    "paper_marl",
)
"""Default scenarios of ``tasks``; ``giant`` takes long, and ``landfire`` needs its rasters."""
GENERAL = tuple(name for name in HEURISTICS if name not in ("clockwise", "rollout", "switching"))
"""The heuristics of the tables: ``clockwise`` is made for a fire in the middle of the map, planners are slow."""
EPISODES = 256
FIRST_SEED = 1_000_000


def calibrate(scenario: str, device: str, episodes: int, overrides: Sequence[str] = ()) -> dict[str, Any]:
    """Return the trees saved by each heuristic on the evaluation seeds of a scenario."""
    env = make_env(scenario, n_worlds=episodes, seed=FIRST_SEED, device=device, overrides=overrides)
    rows = play_heuristics(env, FIRST_SEED, GENERAL)
    return {"scenario": scenario, "episodes": episodes} | {name: summarise(rows[name]["saved"]) for name in GENERAL}


def pair(
    scenario: str, device: str, episodes: int, policies: Sequence[str], overrides: Sequence[str] = ()
) -> dict[str, Any]:
    """Return the trees saved by some heuristics, the gain of the last, and the time of each.

    Returns:
        ``calibrate``'s row for these heuristics, with ``differences``, of the last to each other one by name, on the
        same fires, and ``seconds`` for each by name: of its play, for 64 steps of one world, on one thread of a
        processor in processor time.
    """
    env = make_env(scenario, n_worlds=episodes, seed=FIRST_SEED, device=device, overrides=overrides)
    saved, seconds, now = {}, {}, clock(device)
    for name in policies:
        start = now()
        played = play(env, HEURISTICS[name](env), FIRST_SEED)
        seconds[name] = 64 * (now() - start) / played["episode_length"].sum()
        saved[name] = played["saved"]
    *others, last = policies
    row = {"scenario": scenario, "episodes": episodes} | {name: summarise(saved[name]) for name in policies}
    return row | {"differences": {name: compare(saved[last], saved[name]) for name in others}, "seconds": seconds}


def rank_rewards(scenario: str, device: str, episodes: int, overrides: Sequence[str] = ()) -> dict[str, Any]:
    """Return the baselines' returns under each reward, unscaled and unshaped, and their trees saved, by policy [n]."""
    env = make_env(scenario, n_worlds=episodes, seed=FIRST_SEED, device=device, overrides=overrides)
    kinds: list[Callable[..., Reward]] = [Efficiency, Coverage, Collaborative, Adaptive, Paper]
    kinds.insert(1, partial(Time, horizon=env.world.horizon))
    rewards = [kind(scale=1.0, shaping=0.0) for kind in kinds]
    returns: dict[str, dict[str, np.ndarray]] = {"saved": {}}
    for policy in BASELINES:
        totals = {type(reward).__name__.lower(): torch.zeros(episodes, device=device) for reward in rewards}

        def pay(transition: Transition, totals: dict[str, torch.Tensor] = totals) -> None:
            for total, reward in zip(totals.values(), rewards, strict=True):
                total += reward(transition).mean((1, 2))

        env.watcher = pay
        returns["saved"][policy] = play(env, HEURISTICS[policy](env), FIRST_SEED)["saved"]
        for name, total in totals.items():
            returns.setdefault(name, {})[policy] = total.double().cpu().numpy()
    return {"scenario": scenario, "episodes": episodes, "returns": returns}


def mean_returns(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row of ``rank_rewards`` averaged over its episodes."""
    means = {
        name: {policy: float(values.mean()) for policy, values in returns.items()}
        for name, returns in row["returns"].items()
    }
    return row | {"returns": means}


def disagreements(returns: dict[str, np.ndarray], saved: dict[str, np.ndarray]) -> list[str]:
    """Return the pairs of policies that a reward ranks against the trees saved.

    A pair counts if the 95 % intervals of both paired differences, in trees saved and in return, exclude 0.

    Args:
        returns: Return of each episode by policy, [n].
        saved: Trees saved, the same.
    """
    against = []
    for one, other in combinations(saved, 2):
        trees, pay = compare(saved[one], saved[other])["ci95"], compare(returns[one], returns[other])["ci95"]
        if (trees[0] > 0.0 and pay[1] < 0.0) or (trees[1] < 0.0 and pay[0] > 0.0):
            against.append(f"{one} and {other}")
    return against


def task_table(rows: list[dict[str, Any]]) -> str:
    """Return the calibration as a Markdown table."""
    count = rows[0]["episodes"]
    lines = [
        f"Trees saved, % (mean of {count} episodes, seeds from {FIRST_SEED}, and its 95 % interval)",
        "",
        "| scenario | " + " | ".join(GENERAL) + " |",
        "|---|" + "---|" * len(GENERAL),
    ]
    for row in rows:
        lines.append(f"| {row['scenario']} | " + " | ".join(interval_cell(row[name]) for name in GENERAL) + " |")
    return "\n".join(lines)


def pair_table(rows: list[dict[str, Any]]) -> str:
    """Return rows of ``pair`` as a Markdown table."""
    policies, others = list(rows[0]["seconds"]), list(rows[0]["differences"])
    titles = [*policies, *(f"{policies[-1]} - {name}" for name in others), *(f"{name} [s]" for name in policies)]
    lines = [
        f"Trees saved, % (mean of so many fires, seeds from {FIRST_SEED}, and its 95 % interval), differences on the",
        "same fires [points], and time for 64 steps of one world [s]",
        "",
        "| scenario | fires | " + " | ".join(titles) + " |",
        "|---|---|" + "---|" * len(titles),
    ]
    for row in rows:
        cells = [row["scenario"], str(row["episodes"]), *(interval_cell(row[name]) for name in policies)]
        for found in row["differences"].values():
            cells.append(difference_cell(found))
        cells += [f"{row['seconds'][name]:.2g}" for name in policies]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def interval_cell(found: dict[str, Any]) -> str:
    """Return a mean of trees saved with its 95 % interval, in %, as a cell of a table."""
    low, high = (100 * bound for bound in found["ci95"])
    return f"{100 * found['mean']:.1f} ({low:.1f} .. {high:.1f})"


def difference_cell(found: Mapping[str, Any]) -> str:
    """Return a paired difference of trees saved with its 95 % interval, in points, as a cell of a table."""
    low, high = (100 * bound for bound in found["ci95"])
    return f"{100 * found['saved_difference']:+.1f} ({low:+.1f} .. {high:+.1f})"


def reward_table(rows: list[dict[str, Any]]) -> str:
    """Return the returns as a Markdown table."""
    lines = [
        f"Mean return of {rows[0]['episodes']} episodes by reward, unscaled and unshaped",
        "",
        "| scenario | reward | " + " | ".join(BASELINES) + " | ranked against trees saved |",
        "|---|---|" + "---|" * (len(BASELINES) + 1),
    ]
    for row in rows:
        for name, returns in row["returns"].items():
            cells = [f"{returns[policy].mean():.3f}" for policy in BASELINES]
            against = ", ".join(disagreements(returns, row["returns"]["saved"])) or "none"
            lines.append(f"| {row['scenario']} | {name} | " + " | ".join(cells) + f" | {against} |")
    return "\n".join(lines)
