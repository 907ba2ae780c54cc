"""Reliability of beliefs: of the cells believed to burn with some chance, the share that burns."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.api.make import make_env
from warp_torchrl.benchmark.tables import entry, table
from warp_torchrl.benchmark.tasks import FIRST_SEED
from warp_torchrl.env.pictures.drawing import BLUE, GRID, ORANGE, SOFT, save_figure, sheet, style
from warp_torchrl.evaluation.statistics import interval
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.records import kept, steps_since
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.world import World

_BOUNDS = (0.05, 0.15, 0.25, 0.4, 0.6, 0.75, 0.85, 0.95)
"""Bounds of the bins. The chances of eight equal members, eighths, lie inside of bins."""
POLICY = "dispatch"


def believed_chance(state: WorldState, world: World) -> Tensor:
    """Return the chance of each cell to burn as a team believes, by fires known and hidden, float32 [B, H, W].

    Raises:
        ValueError: If the team has no belief in common.
    """
    known, hidden = world.believed_fire(state)
    if known.shape[1] > 1:
        raise ValueError("beliefs are measured with belief.of=team")
    return (1.0 - (1.0 - known) * (1.0 - hidden))[:, 0]


def counted(chance: Tensor, burns: Tensor, counts: Tensor) -> Tensor:
    """Count cells by bins of chance: their number, the sum of their chances, and those that burn, float64 [B, 3, bins].

    Args:
        chance: To burn, as is believed, float32 [B, ...].
        burns: Whether they do, bool [B, ...].
        counts: Which count, bool [B, ...].
    """
    bins = torch.bucketize(chance, torch.tensor(_BOUNDS, device=chance.device)).flatten(1)
    values = torch.stack([torch.ones_like(chance), chance, burns.to(chance.dtype)], dim=1).to(torch.float64)
    values = values.flatten(2) * counts.flatten(1)[:, None]
    total = values.new_zeros(len(chance), 3, len(_BOUNDS) + 1)
    return total.scatter_add_(2, bins[:, None].expand(values.shape), values)


def reliability(scenario: str, device: str, episodes: int, overrides: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Return a row for each bin of chances. It counts the cells out of sight at every step of ``dispatch``."""
    env = make_env(scenario, n_worlds=1, device=device, overrides=["belief=ensemble", *overrides])
    world = env.world
    seed = torch.arange(FIRST_SEED, FIRST_SEED + episodes, device=device)
    state, policy = world.reset(seed, torch.zeros_like(seed)), HEURISTICS[POLICY](env)
    total = torch.zeros(episodes, 3, len(_BOUNDS) + 1, dtype=torch.float64, device=device)
    for _ in range(world.horizon):
        state = world.step(state, policy.act(state, world.possible_actions(state))).after
        unseen = steps_since(kept(state).amax(dim=1), state.step) > 0
        counts = unseen & ~state.done[:, None, None]
        total += counted(believed_chance(state, world), is_burning(state.cells), counts)
    ends = (0.0, *_BOUNDS, 1.0)
    bins = zip(ends[:-1], ends[1:], total.cpu().numpy().transpose(2, 1, 0), strict=True)
    return [{"scenario": scenario, "from": low, "to": high, **_row(*own)} for low, high, own in bins if own[0].any()]


def _row(cells: np.ndarray, chances: np.ndarray, burns: np.ndarray) -> dict[str, Any]:
    """Return the means over the cells of a bin, each [fires], and the interval over fires of those that burn."""

    def share(fires: np.ndarray) -> np.ndarray:
        return burns[fires].sum(axis=-1) / np.maximum(cells[fires].sum(axis=-1), 1.0)

    total = cells.sum()
    bounds = interval(np.arange(len(cells)), share)
    return {"cells": int(total), "believed": chances.sum() / total, "burns": burns.sum() / total, "ci95": bounds}


def belief_table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the bins as a table."""
    return table(
        [
            entry("scenario"),
            ("believed to burn", lambda row: f"{row['from']:.2f} .. {row['to']:.2f}"),
            entry("cells", pattern="{:,}"),
            entry("mean chance", "believed", "{:.3f}"),
            entry("burns", pattern="{:.3f}"),
            ("95 % over fires", lambda row: "{:.3f} .. {:.3f}".format(*row["ci95"])),
        ],
        rows,
    )


def draw_reliability(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw the share that burns over the chance that it was believed to, a line for each scenario.

    Args:
        rows: What ``reliability`` returns, of one scenario or several.
        path: PNG to write.
    """
    with style():
        figure, axes = sheet([["bins"]], (3.6, 3.6), "Cells out of sight")
        panel = axes["bins"]
        panel.grid(color=GRID, linewidth=0.5)
        panel.set_axisbelow(True)
        panel.plot([0, 1], [0, 1], color=SOFT, linewidth=0.8, linestyle="--", label="calibrated")
        names = list(dict.fromkeys(row["scenario"] for row in rows))
        for place, name in enumerate(names):
            own = [row for row in rows if row["scenario"] == name]
            believed, burns = ([row[each] for row in own] for each in ("believed", "burns"))
            low, high = zip(*(row["ci95"] for row in own), strict=True)
            color = (BLUE, ORANGE)[place % 2]
            panel.plot(believed, burns, "o-", color=color, markersize=3.0, linewidth=1.2, label=name)
            panel.vlines(believed, low, high, color=color, linewidth=0.8)
        panel.set_xlabel("believed to burn")
        panel.set_ylabel("burns")
        figure.legend(loc="outside lower center", ncols=3)
        save_figure(figure, path)
