"""Measurements of the automaton for the figures."""

import math
from typing import Literal

import torch
from torch import Tensor

from warp_torchrl.prediction.simulation import fire_history
from warp_torchrl.world.air.wind import Calm, Wind
from warp_torchrl.world.arrays.random import Stream, uniform, world_key
from warp_torchrl.world.fires.burn import FireHistory, burn, start_burning
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.state import FIRST_FIRE, OLDEST, Cover, Landscape, WorldState

Kernel = Literal["alexandridis", "ellipse"]
CALM_HAZARD = 0.05
"""Calm hazard of a burning cell on a neighbour in one tick, in measurements of ellipses."""


def snapshots(
    ground: Landscape, fire: Fire, wind: Wind, at: tuple[int, ...], seed: int, cell_size: float
) -> list[WorldState]:
    """Return one world at each of these ticks, from a forest in which nothing burns yet.

    Args:
        ground: The landscape of one world.
        fire: The automaton.
        wind: The air.
        at: Ticks, in order.
        seed: Seed of the world's draws.
        cell_size: Side of a cell [m].
    """
    state = start_burning(ground, wind=wind, fire=fire, first_tick=0, stage_age=None, seed=seed, cell_size=cell_size)
    states, now = [], 0
    for tick in at:
        state, now = burn(state, fire, wind, tick - now), tick
        states.append(state)
    return states


def point_fires(
    fire: Fire,
    size: tuple[int, int],
    lit: tuple[int, int],
    *,
    ticks: int,
    worlds: int,
    wind: tuple[float, float] = (0.0, 0.0),
    radius: int = 1,
    seed: int = 0,
) -> FireHistory:
    """Burn many worlds of old forest on flat ground, each from a square of 2 ``radius`` + 1 cells round ``lit``."""
    cells = torch.full((1, *size), OLDEST, dtype=torch.uint8)
    cells[:, lit[0] - radius : lit[0] + radius + 1, lit[1] - radius : lit[1] + radius + 1] = FIRST_FIRE
    cells = cells.expand(worlds, -1, -1).contiguous()
    return fire_history(
        cells, torch.full_like(cells, Cover.FOREST), wind=wind, fire=fire, ticks=ticks, seed=seed, cell_size=30.0
    )


def diagonal_over_axis(arrival: Tensor, near: int, far: int) -> float:
    """Return a fire's speed along the diagonals over that along the axes, 1 where it grows round.

    Args:
        arrival: Mean ticks until each cell burned, from a fire in the middle, float32 [H, W] with H = W odd.
        near: Distance from the middle from which speeds are taken [cells].
        far: Distance to which they are [cells].
    """
    middle = arrival.shape[0] // 2

    def time_for_a_cell(directions: list[tuple[int, int]], step: float) -> Tensor:
        first, last = round(near / step), round(far / step)
        times = [
            arrival[middle + last * row, middle + last * column]
            - arrival[middle + first * row, middle + first * column]
            for row, column in directions
        ]
        return torch.stack(times).mean() / ((last - first) * step)

    axes = time_for_a_cell([(0, 1), (0, -1), (1, 0), (-1, 0)], 1.0)
    diagonals = time_for_a_cell([(1, 1), (1, -1), (-1, 1), (-1, -1)], math.sqrt(2.0))
    return (axes / diagonals).item()


# Fires in the wind


def steady_fire(kernel: Kernel, refinement: int = 6) -> HazardFire:
    """Return a fire whose cells spread for five times ``refinement`` ticks, with calm hazard 0.05 a tick."""
    alpha = -math.expm1(-CALM_HAZARD * refinement)
    return HazardFire(kernel=kernel, refinement=refinement, burning_stages=5, alpha=(0.0, 0.0, 0.0, alpha, 0.0))


def fires_in_wind(
    speed: float, kernel: Kernel, reach: int, worlds: int, seed: int = 0
) -> tuple[Tensor, tuple[int, int]]:
    """Return how likely each cell is to have burned when a fire's head has come ``reach`` cells to the east.

    Args:
        speed: Of a west wind [m/s].
        kernel: ``ellipse`` or ``alexandridis``.
        reach: From the first fire's middle [cells].
        worlds: Worlds that the mean is taken over.
        seed: Seed of the first world.

    Returns:
        Share of the worlds, float32 [H, W], and the first fire's middle (row, column).

    Raises:
        ValueError: If the fire does not come so far, or its outline reaches the map's border.
    """
    flank = reach + 12 if speed < 2.0 else round(0.8 * reach)
    size, lit = (2 * flank + 1, flank + reach + 16), (flank, flank)
    ticks = round(reach * (7.5 if speed < 4.0 else 5.5))
    history = point_fires(steady_fire(kernel), size, lit, ticks=ticks, worlds=worlds, wind=(speed, 0.0), seed=seed)
    arrival = torch.where(history.arrival >= 0, history.arrival, ticks + 1)
    at_reach = arrival[:, :, lit[1] + reach].amin(dim=1).float()
    there = (at_reach <= ticks).float().mean()
    if there < 0.5:
        raise ValueError(f"reach must be less than fires come in {ticks} ticks, got {reach}")
    burned = (arrival <= at_reach.median()).float().mean(dim=0)
    if max(burned[0].max(), burned[-1].max(), burned[:, 0].max(), burned[:, -1].max()) >= 0.5:
        raise ValueError(f"speed must leave the outline on the map, got {speed}")
    return burned, lit


def burned_in_wind(
    fire: HazardFire, speed: float, bearing: float, ticks: int, worlds: int, seed: int = 0
) -> tuple[float, float]:
    """Return what a fire in a forest burns in a time, and how far its head comes; means over worlds [cells].

    Args:
        fire: The law.
        speed: Of the wind [m/s].
        bearing: Where it blows to, counter-clockwise from east [degrees].
        ticks: The time.
        worlds: Worlds that the means are taken over.
        seed: Seed of the first world.

    Raises:
        ValueError: If a fire reaches the map's border.
    """
    angle = math.radians(bearing)
    east, north = math.cos(angle), math.sin(angle)
    far = 40 + round(ticks * min(1.0, 0.1 + speed / 10.0))
    lit = (round(far * north) + 40, 40)
    size = (lit[0] + 41, round(far * east) + 81)
    history = point_fires(fire, size, lit, ticks=ticks, worlds=worlds, wind=(speed * east, speed * north), seed=seed)
    burned = history.arrival >= 0
    if any(side.any() for side in (burned[:, 0], burned[:, -1], burned[:, :, 0], burned[:, :, -1])):
        raise ValueError(f"ticks must leave fires on the map, got {ticks}")
    rows, columns = (torch.arange(side) - middle for side, middle in zip(size, lit))
    along = columns * east - rows[:, None] * north
    head = torch.where(burned, along, -math.inf).flatten(1).amax(dim=1)
    return burned.sum(dim=(1, 2)).float().mean().item(), head.mean().item()


def length_over_breadth(burned: Tensor) -> float:
    """Return the length over the breadth of where a fire in a west wind burns with probability 0.5 or more.

    Each is the widest distance between the outline's crossings, interpolated between cells.

    Args:
        burned: Share of the worlds in which each cell burned, float32 [H, W], below 0.5 along the border.
    """
    return (_extent(burned.amax(dim=0)) / _extent(burned.amax(dim=1))).item()


def _extent(profile: Tensor) -> Tensor:
    """Return the distance between the first and the last crossing of 0.5 [cells]."""
    inside = (profile >= 0.5).nonzero()[:, 0]
    first, last = inside[0], inside[-1]
    before = (profile[first] - 0.5) / (profile[first] - profile[first - 1])
    after = (profile[last] - 0.5) / (profile[last] - profile[last + 1])
    return last - first + before + after


# Fire sizes


def strike_and_burn(
    size: int, trees_per_strike: int, fires: int, *, worlds: int = 4, discard: int = 0, seed: int = 0
) -> tuple[Tensor, WorldState]:
    """Let a forest grow and lightning strike it, in the limit of slow lightning and instantaneous fires.

    Trees grow on empty ground while nothing burns, ``trees_per_strike`` times the share of empty ground; lightning
    strikes one tree; the automaton, certain to spread, burns to the end while nothing grows; and so on
    (Drossel and Schwabl 1992). Each world goes at its own pace.

    Args:
        size: Side of a map [cells].
        trees_per_strike: Trials to grow a tree between two strikes, theta = p / f.
        fires: Fires to keep.
        worlds: Forests that grow side by side.
        discard: Fires that come first and are not kept, until the forest is in its steady state.
        seed: Seed of the first world.

    Returns:
        Trees burned by each fire, int64 [``fires``], and the forests at the end.
    """
    fire = Fire(alpha=(0.0, 0.0, 0.0, 1.0, 0.0), diagonal="unit", youngest_fuel=1)
    grow = Fire(alpha=fire.alpha, p_regrow=trees_per_strike / size**2)
    key = world_key(seed + torch.arange(worlds))
    cells = (uniform(key, 0, Stream.AGE, (size, size)) < 0.25).to(torch.uint8)
    state = start_burning(
        Landscape(torch.full_like(cells, Cover.FOREST), cells, None),
        wind=Calm(), fire=fire, first_tick=0, stage_age=None, seed=seed, cell_size=30.0,
    )  # fmt: skip
    certain = torch.full(cells.shape, 0.5)  # every chance is 0 or 1: any number will do
    all_worlds, trees = torch.ones(worlds, dtype=torch.bool), is_tree(cells).sum((1, 2))
    sizes: list[int] = []
    struck = torch.zeros(worlds, dtype=torch.bool)
    while len(sizes) < fires + discard:
        out = ~is_burning(state.cells).flatten(1).any(dim=1)
        if out.any():
            left = is_tree(state.cells).sum((1, 2))
            sizes += (trees - left)[out & struck].tolist()
            draws = uniform(key, state.tick, Stream.FIRE, (size, size))
            state = grow.tick(state, draws, out)
            trees = torch.where(out, is_tree(state.cells).sum((1, 2)), trees)
            state = _strike(state, uniform(key, state.tick, Stream.IGNITION, (size, size)), out)
            struck = struck | out
        state = fire.tick(state, certain, all_worlds)
    return torch.tensor(sizes[discard : discard + fires]), state


def _strike(state: WorldState, draws: Tensor, where: Tensor) -> WorldState:
    """Set fire to one tree of each world where lightning strikes, bool [B]."""
    best = (draws * is_tree(state.cells)).flatten(1).argmax(dim=1)
    struck = torch.zeros_like(state.cells, dtype=torch.bool)
    struck.flatten(1).scatter_(1, best[:, None], where[:, None])
    return state.replace(cells=torch.where(struck, FIRST_FIRE, state.cells))


def fitted_exponent(sizes: Tensor, smallest: int, largest: int) -> tuple[float, float]:
    """Return the exponent t of P(s) ~ s^-t between two sizes, by maximum likelihood, and its standard error.

    The law is that of whole numbers from ``smallest`` to ``largest`` (Clauset, Shalizi and Newman 2009).
    """
    logarithm = sizes[(sizes >= smallest) & (sizes <= largest)].double().log()
    exponents = torch.linspace(0.0, 4.0, 4001, dtype=torch.float64)
    support = torch.arange(smallest, largest + 1, dtype=torch.float64).log()
    weight = torch.exp(-exponents[:, None] * support)
    likelihood = -exponents * logarithm.mean() - weight.sum(dim=1).log()
    best = int(likelihood.argmax())
    share = weight[best] / weight[best].sum()
    variance = (share * support.square()).sum() - (share * support).sum().square()
    return exponents[best].item(), (1.0 / (len(logarithm) * variance).sqrt()).item()
