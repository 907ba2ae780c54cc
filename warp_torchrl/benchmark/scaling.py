"""Growth of the cost of a step with worlds, agents and cells, and memory of a world."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from torch import Tensor

from warp_torchrl.api.make import make_env
from warp_torchrl.benchmark.machine import peak_memory
from warp_torchrl.benchmark.tables import entry, spread_of, table
from warp_torchrl.benchmark.timing import clock, spread

if TYPE_CHECKING:
    from warp_torchrl.env import WildfireEnv

WORLD_COUNTS = (1, 4, 16, 64, 256, 1024)
AGENT_COUNTS = (1, 2, 4, 8, 16)
MAP_SIDES = (16, 32, 64, 128)
_STEPS = 5  # in a repeat


def growth(
    scenario: str, n_worlds: int, device: str, overrides: Sequence[str] = (), repeats: int = 7
) -> list[dict[str, Any]]:
    """Measure a step of the environment for more and more worlds, then agents, then cells.

    The steps are the first of episodes, at random: all worlds burn, and none is reset in them.

    Args:
        scenario: One of ``conf/scenario``: the map and the team of the first sweep.
        n_worlds: B of the other two; the first goes to four times as many.
        device: Where the worlds live.
        overrides: In the command line's grammar.
        repeats: Times that each is measured.

    Returns:
        A row for each size, with ``ms_per_step``, ``agent_steps_per_second``, ``kib_per_world``, the bytes of a world's
        state and of what the environment shows of it, and ``peak_gib``, the most that the process has held until then.
    """
    none: list[str] = []
    sweeps = [("worlds", count, count, none) for count in WORLD_COUNTS if count <= 4 * n_worlds]
    sweeps += [("agents", count, n_worlds, [f"team.n_agents={count}"]) for count in AGENT_COUNTS]
    sweeps += [("cells", side, n_worlds, [f"landscape.size={side}"]) for side in MAP_SIDES]
    return [
        {"varies": varies} | _step_cost(scenario, worlds, device, [*overrides, *more], repeats)
        for varies, _, worlds, more in sweeps
    ]


def growth_table(rows: list[dict[str, Any]]) -> str:
    """Return the growth as a table for the terminal."""
    columns = [
        entry("varies"),
        entry("worlds"),
        entry("agents"),
        entry("map", "size"),
        entry("ms a step", "ms_per_step", "{:.2f}"),
        spread_of("{:.2f}"),
        entry("agent steps/s", "agent_steps_per_second", "{:,.0f}"),
        entry("KiB a world", "kib_per_world", "{:,.0f}"),
        entry("peak GiB", "peak_gib", "{:.2f}"),
    ]
    return table(columns, rows)


def _step_cost(scenario: str, n_worlds: int, device: str, overrides: Sequence[str], repeats: int) -> dict[str, Any]:
    env = make_env(scenario, n_worlds=n_worlds, device=device, overrides=overrides)
    shown = env.step(env.rand_action(env.reset()))["next"]
    held = _bytes(env.shared_state.leaves().values()) + _bytes(shown.values(True, True))
    memory = {
        "kib_per_world": held / n_worlds / 1024,
        "peak_gib": peak_memory(),  # before the timing, which keeps a copy of the worlds
    }
    found = spread("ms_per_step", [1000.0 * seconds for seconds in _first_steps(env, device, repeats)])
    height, width = env.world.size
    return {
        "scenario": scenario,
        "worlds": n_worlds,
        "agents": env.n_agents,
        "cells": height * width,
        "size": f"{height} x {width}",
        **found,
        "agent_steps_per_second": n_worlds * env.n_agents * 1000.0 / found["ms_per_step"],
        **memory,
    }


def _first_steps(env: "WildfireEnv", device: str, repeats: int) -> list[float]:
    """Return the time of a step [s], as often as asked, after steps that do not count."""
    now, seconds = clock(device), []
    start = env.shared_state.clone()  # one step old
    for _ in range(repeats + 1):
        shown = env.set_state(start)
        begin = now()
        for _ in range(_STEPS):
            shown = env.step(env.rand_action(shown))["next"]
        seconds.append(max(now() - begin, 1e-9) / _STEPS)
    return seconds[1:]


def _bytes(tensors: Iterable[Tensor]) -> int:
    return sum(tensor.numel() * tensor.element_size() for tensor in tensors)
