"""Benchmark of a GPU in under five minutes, as one JSON: speed, waits, memory, and equality with a CPU's worlds.

Each part is written when it is done; a part that fails is replaced by its error, so that the others are not lost.
"""

import gc
import json
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import torch

from warp_torchrl.api.make import make_env
from warp_torchrl.benchmark.environments import random_play
from warp_torchrl.benchmark.machine import machine, peak_memory
from warp_torchrl.benchmark.timing import clock, spread, take_turns
from warp_torchrl.benchmark.waits import counted_waits
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.system import disk
from warp_torchrl.system.device import unread
from warp_torchrl.training.loop import Training
from warp_torchrl.world.backends.tick import advance

_SCENARIO = "skirmish"
_WAYS: dict[str, dict[str, Any]] = {"eager": {}, "graph": {"graph": True}, "compiled": {"compile": True}}


@dataclass(frozen=True, kw_only=True)
class Size:
    """Size of the benchmark.

    Attributes:
        worlds: Numbers of worlds for ticks and steps.
        steps: Steps per repeat.
        repeats: Repeats of each speed.
        compared: Number of worlds that are compared with the CPU's, and number of steps.
        starts: Number of worlds whose starts are compared.
        training: Overrides of the recipe.
        ways: Some of ``_WAYS``.
        seconds: Time after which no further part begins [s].
    """

    worlds: tuple[int, ...] = (256, 1024, 4096, 8192, 16384)
    steps: int = 32
    repeats: int = 3
    compared: tuple[int, int] = (256, 128)
    starts: int = 16384
    training: tuple[str, ...] = ("experiment=gpu",)
    ways: tuple[str, ...] = ("eager", "graph", "compiled")
    seconds: float = 240.0


SMALL = Size(
    worlds=(2, 4),
    steps=2,
    repeats=1,
    compared=(2, 8),
    starts=8,
    training=("n_worlds=4", "collector.steps=8", "horizon=8", "model.actor_hidden=[8]", "model.critic_hidden=[8]"),
    ways=("eager", "graph"),
)
"""What a CPU measures in its place, without compiling, to show that all of it runs."""


def measure_gpu(device: str, path: Path, size: Size, progress: Callable[[str], object] = print) -> bool:
    """Measure everything, write it to a file as JSON, and return whether every part was measured.

    Args:
        device: ``cuda``, or ``cpu``, which runs the GPU's code.
        path: The file.
        size: Size of the benchmark.
        progress: Called with a line about each part.
    """
    begin = time.perf_counter()
    found: dict[str, Any] = {"machine": _machine(device), "scenario": _SCENARIO}
    parts: dict[str, Callable[[], Any]] = {
        "equality": partial(_equality, device, *size.compared),
        "starts": partial(_starts, device, size.starts),
        "waits": partial(_waits, device, size.training),
        **{f"steps {n}": partial(_steps, device, n, size) for n in size.worlds},
        **{f"training {way}": partial(_training, device, way, size) for way in size.ways},
    }
    sound = True
    for name, part in parts.items():
        if time.perf_counter() - begin > size.seconds:
            found[name] = {"skipped": f"{size.seconds:g} s had passed"}
        else:
            found[name] = _result(part, device)
        sound = sound and "error" not in found[name]
        found["seconds"] = round(time.perf_counter() - begin, 1)
        disk.replace(path, json.dumps(found, indent=1) + "\n")
        progress(f"{found['seconds']:6.1f} s  {name}: {_line(found[name])}")
    return sound


def _result(part: Callable[[], Any], device: str) -> dict[str, Any]:
    """Return the result of a part, or its error: on a borrowed card the other parts are still worth their figures."""
    try:
        with unread() if device == "cpu" else nullcontext():
            return part()
    except Exception as error:
        return {"error": f"{type(error).__name__}: {error}", "traceback": traceback.format_exc()}


def _line(found: dict[str, Any]) -> str:
    return str(found.get("error") or found.get("skipped") or found).replace("\n", " ")[:400]


def _machine(device: str) -> dict[str, Any]:
    found = machine(device)
    if device == "cpu":
        return found
    card = torch.cuda.get_device_properties(device)
    return found | {
        "cuda": torch.version.cuda,
        "capability": f"{card.major}.{card.minor}",
        "processors": card.multi_processor_count,
        "memory_gib": card.total_memory / 2**30,
    }


def _equality(device: str, n_worlds: int, steps: int) -> dict[str, Any]:
    """Play the same actions on the device and on the CPU, and return the differences of worlds and observations."""
    here = make_env(_SCENARIO, n_worlds=n_worlds, device="cpu")
    there = make_env(_SCENARIO, n_worlds=n_worlds, device=device)
    one, other, seen = here.reset(), there.reset(), {"reward": 0.0, "observation": 0.0}
    for _ in range(steps):
        action = here.rand_action(one)["agents", "action"]
        first, one = here.step_and_maybe_reset(one.set(("agents", "action"), action))
        second, other = there.step_and_maybe_reset(other.set(("agents", "action"), action.to(there.device)))
        for name in seen:
            mine, its = first["next", "agents", name], second["next", "agents", name].to("cpu")
            seen[name] = max(seen[name], _furthest(mine - its if name == "reward" else (mine.double() - its.double())))
    mine, its = here.shared_state.what_changes(), there.shared_state.to("cpu").what_changes()
    differing = {name: int((leaf != its[name]).sum()) for name, leaf in mine.items() if (leaf != its[name]).any()}
    return {"worlds": n_worlds, "steps": steps, "differing": differing, "furthest": seen}


def _starts(device: str, n_worlds: int) -> dict[str, Any]:
    """Return the number of worlds that start differently on the device and on the CPU, and the fields that differ."""
    here, there = (make_env(_SCENARIO, n_worlds=n_worlds, device=each) for each in ("cpu", device))
    here.reset()
    there.reset()
    mine, its = here.shared_state, there.shared_state.to("cpu").leaves()
    unlike = {name: (leaf != its[name]).reshape(n_worlds, -1).any(1) for name, leaf in mine.leaves().items()}
    return {"worlds": n_worlds, "differing": {name: int(each.sum()) for name, each in unlike.items() if each.any()}}


def _furthest(gaps: Any) -> float:
    leaves = gaps.values(True, True) if hasattr(gaps, "batch_size") else [gaps]
    return max(float(leaf.double().abs().max()) for leaf in leaves)


def _waits(device: str, overrides: tuple[str, ...]) -> dict[str, Any]:
    """Return the synchronisations of steps, and of an iteration of training, by line."""
    with _trained(device, [*overrides]) as (training, batches):
        training._learn(next(batches))
        shown, policy = training.env.reset(), training.learner.explore
        shown = training.env.step_and_maybe_reset(policy(shown))[1]
        with counted_waits(device) as step:
            training.env.step_and_maybe_reset(policy(shown))
        with counted_waits(device) as iteration:
            training._learn(next(batches))
    return {"step": step.count, "iteration": iteration.count, "places": dict(iteration.places + step.places)}


def _steps(device: str, n_worlds: int, size: Size) -> dict[str, Any]:
    """Return the rates of ticks and, each way, of steps with observations, rewards, metrics and resets."""
    _forget_peak(device)
    parts: dict[str, Callable[[], Any]] = {way: partial(_steps_by, way, device, n_worlds, size) for way in size.ways}
    parts["tick"] = partial(_ticks, device, n_worlds, size)
    found = {name: _result(part, device) for name, part in parts.items()}
    failed = [each["error"] for each in found.values() if "error" in each]
    return found | ({"error": failed[0]} if failed else {}) | {"peak_gib": _peak(device)}


def _steps_by(way: str, device: str, n_worlds: int, size: Size) -> dict[str, Any]:
    env = make_env(_SCENARIO, n_worlds=n_worlds, device=device, **_WAYS[way])
    play = random_play(env)
    now = clock(device)
    start = now()
    play(size.steps)
    first = now() - start
    seconds = take_turns({way: partial(play, size.steps)}, size.repeats, device)[way]
    rates = [n_worlds * env.n_agents * size.steps / each for each in seconds]
    return {**spread("agent_steps_per_second", rates), "first_steps_seconds": first}


def _ticks(device: str, n_worlds: int, size: Size) -> dict[str, Any]:
    env = make_env(_SCENARIO, n_worlds=n_worlds, device=device)
    random_play(env)(size.steps)
    state, world = env.shared_state, env.world
    due = torch.ones(n_worlds, dtype=torch.bool, device=device)
    seconds = take_turns({"tick": lambda: advance(state, world.fire, world.air, due)}, size.repeats, device)["tick"]
    cells = state.cells.numel()
    return spread("cells_per_second", [cells / each for each in seconds])


def _training(device: str, way: str, size: Size) -> dict[str, Any]:
    """Return the rate of collection and learning of the recipe."""
    _forget_peak(device)
    extra = [f"{name}={str(name in _WAYS[way]).lower()}" for name in ("graph", "compile")]
    with _trained(device, [*size.training, *extra]) as (training, batches):
        now = clock(device)
        agents = training.env.n_agents * training.frames_per_batch

        def batch() -> None:
            training._learn(next(batches))

        start = now()
        batch()
        first = now() - start
        seconds = take_turns({way: batch}, size.repeats, device)[way]
    rates = spread("agent_steps_per_second", [agents / each for each in seconds])
    return {**rates, "first_batch_seconds": first, "peak_gib": _peak(device)}


@contextmanager
def _trained(device: str, overrides: list[str]) -> Iterator[tuple[Training, Iterator[Any]]]:
    built = run_config(plain(compose_config("train", [*overrides, "processes=1", f"device={device}"])))
    with tempfile.TemporaryDirectory() as folder:
        training = Training(built, SavedConfig(), Path(folder))
        try:
            yield training, training.batches()
        finally:
            training.close()


def _forget_peak(device: str) -> None:
    gc.collect()  # what the part before has left would count
    if device != "cpu":
        torch.cuda.empty_cache()
        torch.cuda.reset_peak_memory_stats(device)


def _peak(device: str) -> float:
    """Return the peak memory [GiB]: of the device, or of the process on a CPU."""
    return peak_memory() if device == "cpu" else torch.cuda.max_memory_allocated(device) / 2**30
