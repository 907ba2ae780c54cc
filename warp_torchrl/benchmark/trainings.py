"""Speed of training: collecting and learning, as ``train.py`` does, and with the paper's software."""

import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from warp_torchrl.algorithms import parallel
from warp_torchrl.benchmark.shares import training_shares
from warp_torchrl.benchmark.stable_baselines import NAME, open_stable_baselines, reason_against
from warp_torchrl.benchmark.timing import spread, take_turns
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.training.following import FOLLOWING
from warp_torchrl.training.loop import Training


def training_speed(
    overrides: Sequence[str], device: str, repeats: int = 7, with_peer: bool = False
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Measure agent steps a second of training: collecting and learning, as ``train.py`` does.

    Args:
        overrides: Of ``train.py``, in the command line's grammar.
        device: Where all of it happens.
        repeats: Batches that are measured, of all ``collector.steps``.
        with_peer: Whether to train with Stable-Baselines3 on the NumPy environment as well.

    Returns:
        A row for each way to train, with ``agent_steps_per_second``; and the shares of our training loop.
    """
    values = plain(compose_config("train", [*overrides, "collector.grows_at=0", f"device={device}"]))
    built = run_config(values)
    agents = built.world.team.n_agents
    common = {"scenario": built.scenario, "size": "{} x {}".format(*built.world.size), "agents": agents}
    common |= {"worlds": built.n_worlds, "processes": built.n_processes()}
    reason = reason_against(built) if with_peer else None
    with ExitStack() as stack:
        stack.enter_context(parallel.processes(built.n_processes(), values, FOLLOWING))
        training = Training(built, SavedConfig(), Path(stack.enter_context(tempfile.TemporaryDirectory())))
        stack.callback(training.close)
        training.join()
        batches = training.batches()

        def learn() -> None:
            training._learn(next(batches))
            training.go_on()

        contenders: dict[str, Callable[[], object]] = {"training": learn}
        if with_peer and reason is None:
            contenders[NAME], close = open_stable_baselines(built)
            stack.callback(close)
        agent_steps = training.frames_per_batch * agents
        rows: list[dict[str, Any]] = [
            {"what": name, **common} | spread("agent_steps_per_second", [agent_steps / second for second in seconds])
            for name, seconds in take_turns(contenders, repeats, device).items()
        ]
        shares = training_shares(training, batches, repeats)
    if len(rows) > 1:
        rows = [row | {"ratio": row["agent_steps_per_second"] / rows[1]["agent_steps_per_second"]} for row in rows]
    skipped = [{"what": NAME, "skipped": reason}] if reason else []
    return rows + skipped, [{"scenario": built.scenario, **row} for row in shares]
