"""How fast the environment and the training are.

Machines are shared and noisy: figures are medians of several repeats, with the spread.
"""

import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import torch

from warp_torchrl.api import make_env
from warp_torchrl.config import Record, compose_config, plain, settings
from warp_torchrl.training import Training


def environment_speed(
    scenario: str, n_worlds: int, device: str, overrides: Sequence[str] = (), repeats: int = 7
) -> dict[str, Any]:
    """Measure agent steps a second of the environment alone: random actions, observations, rewards and resets."""
    env = make_env(scenario, n_worlds=n_worlds, device=device, overrides=overrides)
    now = env.reset()

    def steps(count: int) -> None:
        nonlocal now
        for _ in range(count):
            _, now = env.step_and_maybe_reset(env.rand_action(now))

    steps(env.world.horizon // 2)  # until worlds end at different times
    return {"what": "environment", "scenario": scenario, "worlds": n_worlds} | _rate(
        steps, 25, n_worlds * env.n_agents, repeats, device
    )


def training_speed(
    scenario: str, n_worlds: int, device: str, overrides: Sequence[str] = (), repeats: int = 7
) -> dict[str, Any]:
    """Measure agent steps a second of training: collecting and learning, as ``train.py`` does."""
    config = plain(
        compose_config("train", [f"scenario={scenario}", f"n_worlds={n_worlds}", f"device={device}", *overrides])
    )
    plan = settings(config)
    with tempfile.TemporaryDirectory() as folder:
        training = Training(plan, Record(), Path(folder))
        batches = iter(training.collector)

        def steps(count: int) -> None:
            for _ in range(count):
                training._learn(next(batches))

        steps(1)
        agents = plan.world.team.n_agents
        result = _rate(steps, 1, training.frames_per_batch * agents, repeats, device)
        training.close()
    return {"what": "training", "scenario": scenario, "worlds": n_worlds} | result


def _rate(steps: Callable[[int], None], count: int, agent_steps: int, repeats: int, device: str) -> dict[str, Any]:
    rates = []
    for _ in range(repeats):
        start = time.perf_counter()
        steps(count)
        if device != "cpu":
            torch.cuda.synchronize()
        rates.append(agent_steps * count / (time.perf_counter() - start))
    return {"agent_steps_per_second": statistics.median(rates), "lowest": min(rates), "highest": max(rates)}


def speed_table(rows: list[dict[str, Any]]) -> str:
    """Return the rates as a table for the terminal."""
    lines = [f"{'':<12}{'scenario':<12}{'worlds':>7}{'agent steps/s':>15}{'lowest .. highest':>24}"]
    for row in rows:
        spread = f"{row['lowest']:,.0f} .. {row['highest']:,.0f}"
        rate = f"{row['agent_steps_per_second']:,.0f}"
        lines.append(f"{row['what']:<12}{row['scenario']:<12}{row['worlds']:>7}{rate:>15}{spread:>24}")
    return "\n".join(lines)
