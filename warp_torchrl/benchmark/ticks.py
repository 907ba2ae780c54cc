"""Cost of a fire tick per cell: eager, compiled, and in NumPy."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch

from warp_torchrl.api.make import make_env
from warp_torchrl.benchmark.numpy_world import NumpyWorld, plays
from warp_torchrl.benchmark.tables import entry, spread_of, table
from warp_torchrl.benchmark.timing import spread, take_turns
from warp_torchrl.system.compiler import check_compiler, compiled
from warp_torchrl.world.backends.tick import advance
from warp_torchrl.world.fires.burn import burn
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.flags import in_bytes
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.world import World

_TICKS = 10  # in a repeat, and before
_NUMPY_WORLDS = 16  # NumPy ticks one world after the other, so a few are enough


def tick_cost(
    scenario: str, n_worlds: int, device: str, overrides: Sequence[str], repeats: int, compiled: bool = True
) -> list[dict[str, Any]]:
    """Measure ``advance``: draws, chances and the new state; and the same worlds in NumPy.

    The fires have burned for ten ticks: those of ``large`` are then about as large as they get, and what a tick at
    their edge costs grows with them.

    Args:
        scenario: One of ``conf/scenario``.
        n_worlds: B.
        device: Where the worlds live.
        overrides: In the command line's grammar.
        repeats: Times that each is measured.
        compiled: Whether to measure the fused tick too, which takes a while to compile.

    Returns:
        A row for each way, with ``ns_per_cell`` and how many times faster than NumPy it is.
    """
    env = make_env(scenario, n_worlds=n_worlds, device=device, overrides=overrides)
    env.reset()
    world = env.world
    state = burn(env.shared_state, world.fire, world.air, _TICKS)
    height, width = world.size
    contenders, cells, skipped = {"eager": _ours(world, state, fuse=False)}, {"eager": n_worlds}, []
    if compiled:
        try:
            check_compiler(torch.device(device))
            contenders["compiled"], cells["compiled"] = _ours(world, state, fuse=True), n_worlds
        except ValueError as error:
            skipped.append({"what": "compiled", "skipped": str(error)})
    if isinstance(world.fire, Fire) and plays(world.fire, world.air):
        peers = [
            numpy_copy(state, index, world.fire, world.side_of_cell) for index in range(min(n_worlds, _NUMPY_WORLDS))
        ]
        contenders["numpy"], cells["numpy"] = _numpy(peers), len(peers)
    else:
        skipped.append({"what": "numpy", "skipped": "it plays law paper in a wind that stays as it is"})
    seconds = take_turns(contenders, repeats, device)
    scale = {name: 1e9 / (_TICKS * count * height * width) for name, count in cells.items()}
    rows: list[dict[str, Any]] = [
        {"what": name, "scenario": scenario, "worlds": cells[name], "size": f"{height} x {width}"}
        | spread("ns_per_cell", [second * scale[name] for second in seconds[name]])
        for name in contenders
    ]
    peer = next((row["ns_per_cell"] for row in rows if row["what"] == "numpy"), None)
    return [row | {"ratio": peer and peer / row["ns_per_cell"]} for row in rows] + skipped


def numpy_copy(state: WorldState, index: int, fire: Fire, cell_size: float) -> NumpyWorld:
    """Return one of some worlds in its present state, in NumPy."""

    def plane(name: str) -> np.ndarray:
        return getattr(state, name)[index].numpy(force=True)

    elevation = state.landscape.elevation
    ground = None if elevation is None else elevation[index].numpy(force=True)
    copy = NumpyWorld(fire, plane("cover"), plane("cells"), plane("wind"), ground, cell_size)
    for name in ("age", "wet", "burned", "extinguished", "firebreak", "initial"):
        copy.on_map(getattr(copy, name))[...] = plane(name)
    return copy


def tick_table(rows: list[dict[str, Any]]) -> str:
    """Return the costs as a table for the terminal."""
    columns = [
        entry("tick", "what"),
        entry("scenario"),
        entry("worlds"),
        entry("map", "size"),
        entry("ns/cell", "ns_per_cell", "{:.2f}"),
        spread_of("{:.2f}"),
        entry("x numpy", "ratio", "{:.1f}"),
    ]
    return table(columns, rows)


def _ours(world: World, state: WorldState, fuse: bool) -> Callable[[], None]:
    ticks_now, tick = torch.ones_like(state.terminated), compiled(advance) if fuse else advance
    first = in_bytes(state) if fuse else state

    def ticks() -> None:
        now = first
        for _ in range(_TICKS):
            now = tick(now, world.fire, world.air, ticks_now)

    return ticks


def _numpy(worlds: list[NumpyWorld]) -> Callable[[], None]:
    rng = np.random.Generator(np.random.SFC64(0))

    def ticks() -> None:
        for world in worlds:
            for _ in range(_TICKS):
                world.tick(rng.random(world.cells.size, dtype=np.float32))

    return ticks
