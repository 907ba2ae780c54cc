"""Metrics of an episode: a table of functions by name, and the rows of the world's mechanics.

A metric reads an ``Episode``. A module of a user's own adds one, which every world then has:

    @metric(better="less")
    def spilt(now: Episode) -> Tensor:
        ...
"""

from collections.abc import Callable
from typing import Literal, NamedTuple, TypeVar

import torch
from torch import Tensor

from warp_torchrl.validation import check_new_name, did_you_mean
from warp_torchrl.world.mechanics.mechanic import Metric, Unit
from warp_torchrl.world.state.state import TreeCounts, WorldState
from warp_torchrl.world.world import World

SUCCESS_LEVEL = 0.6


class Episode(NamedTuple):
    """What a metric is computed of: each world's episode so far."""

    state: WorldState
    counts: TreeCounts
    world: World


Function = TypeVar("Function", bound=Callable[[Episode], Tensor])


class Row(NamedTuple):
    """A row of the table."""

    metric: Metric
    compute: Callable[[Episode], Tensor]
    """Returns it, float32 [B]."""


METRICS: dict[str, Row] = {}
"""The metrics of every world, by name and in the order of tables."""


def metric(
    better: Literal["more", "less", ""] = "", unit: Unit = "%", title: str = "", table: str = ""
) -> Callable[[Function], Function]:
    """Return what adds a function to the table, under the function's name; see ``Metric``.

    Raises:
        ValueError: If the table has another metric of that name.
    """

    def added(compute: Function) -> Function:
        name = compute.__name__
        check_new_name("metric", name, compute, METRICS[name].compute if name in METRICS else None)
        METRICS[name] = Row(Metric(name, better, unit, title, table), compute)
        return compute

    return added


def metric_rows(world: World) -> tuple[Metric, ...]:
    """Return the rows of a world's metrics: those of the table, then those of its mechanics."""
    return (*(row.metric for row in METRICS.values()), *(row for each in world.loop for row in each.metric_rows(world)))


def chosen_goal(world: World) -> Metric | None:
    """Return the metric that a world names as its goal; None where it names none.

    Raises:
        ValueError: If it is none of its metrics, or neither more nor less of it is better.
    """
    if world.goal is None:
        return None
    known = {row.name: row for row in metric_rows(world) if row.better}
    if world.goal not in known:
        hint = did_you_mean(world.goal, known)
        raise ValueError(f"goal must be one of {', '.join(known)}, got {world.goal}{hint}")
    return known[world.goal]


def metrics(state: WorldState, counts: TreeCounts, world: World) -> dict[str, Tensor]:
    """Return the metrics of each world's episode so far, float32 [B] each, see ``METRICS`` and ``Mechanic.metrics``.

    Args:
        state: The worlds.
        counts: Of their trees.
        world: Their rules.
    """
    now = Episode(state, counts, world)
    found = {name: row.compute(now) for name, row in METRICS.items()}
    for each in world.loop:
        found |= each.metrics(state)
    return found


@metric(better="more")
def saved(now: Episode) -> Tensor:
    """Return the share of the initial trees that stand untouched or put out."""
    return now.counts.saved()


@metric(better="less")
def burned(now: Episode) -> Tensor:
    """Return the share of the initial trees that burned down."""
    return now.counts.burned / now.counts.initial


@metric()
def extinguished(now: Episode) -> Tensor:
    """Return the share of the initial trees that were put out."""
    return now.counts.extinguished / now.counts.initial


@metric(better="less")
def cleared(now: Episode) -> Tensor:
    """Return the share of the initial trees that agents cleared."""
    return now.counts.cleared / now.counts.initial


@metric(better="less")
def burning(now: Episode) -> Tensor:
    """Return the share of the initial trees that burn."""
    return now.counts.burning / now.counts.initial


@metric(better="less")
def burning_area(now: Episode) -> Tensor:
    """Return the area under the curve of burning trees, mean share over the horizon."""
    return now.state.burning_area / now.world.horizon


@metric(better="less", unit="1")
def control_time(now: Episode) -> Tensor:
    """Return the agent steps until no cell burned, or until now, as a share of the horizon."""
    return now.state.step / now.world.horizon


@metric()
def actions(now: Episode) -> Tensor:
    """Return the extinguish and clear actions, a share of the agents' steps."""
    acts = now.state.vehicles.acts
    return acts.sum(1) / (now.state.step * acts.shape[1]).clamp(min=1)


@metric(better="less")
def redundant(now: Episode) -> Tensor:
    """Return the share of those on a target that a team-mate had."""
    vehicles = now.state.vehicles
    return vehicles.redundant.sum(1) / vehicles.acts.sum(1).clamp(min=1)


@metric(better="more")
def success(now: Episode) -> Tensor:
    """Return 1 where the fire is out and at least 60 % of the initial trees are saved."""
    return ((now.counts.alight == 0) & (now.counts.saved() >= SUCCESS_LEVEL)).to(torch.float32)
