"""Burn probability of one ground over many fires, without the team and with it.

Ground, trees and relief are those of one seed. The place of ignition, the wind, the fire's draws and the team's start
differ from fire to fire, as the scenario defines them. Both arms play the same fires: the same seeds, and so the same
draws cell by cell and tick by tick. A cell counts as burned in a fire if its tree has burned to ash, or still burns, at
the end of the episode: at the horizon, or earlier when the fire is out. A tree that was extinguished stands and does
not count, nor does one that the team cleared.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.pictures.maps import MapPanel, save_maps
from warp_torchrl.evaluation.play import play
from warp_torchrl.evaluation.statistics import summarise
from warp_torchrl.heuristics import NoOp
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.system import disk
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.state import Landscape, WorldState
from warp_torchrl.world.terrain.fixed import Fixed
from warp_torchrl.world.terrain.geotiff import local_grid, write_geotiff
from warp_torchrl.world.terrain.grid import Grid

Actor = Callable[[WildfireEnv], TensorDictModuleBase]
"""Gives the policy for an environment."""
_CELLS_AT_ONCE = 2**20
"""Of the worlds that are played together: some hundred bytes a cell."""
_MOST_WORLDS = 256


@dataclass(frozen=True, kw_only=True, eq=False)
class PolicyMaps:
    """Burned cells of fires on one ground, without the team and with it.

    Attributes:
        ground: The ground, batch size [1].
        cell_size: Side of a cell [m].
        seeds: First seed of the fires, and how many there are.
        horizon: Agent steps to an episode.
        without: Share of the fires in which each cell burned without the team, float32 [H, W]; NaN without a tree.
        with_team: The same with the team.
        lit: Where any fire burned when the team came, after its head start, bool [H, W].
        area_without: Area burned in each fire without the team, float64 [n] [ha].
        area_with: The same with the team.
        cleared: Area that the team cleared in each fire, float64 [n] [ha].
    """

    ground: Landscape
    cell_size: float
    seeds: tuple[int, int]
    horizon: int
    without: Tensor
    with_team: Tensor
    lit: Tensor
    area_without: np.ndarray
    area_with: np.ndarray
    cleared: np.ndarray

    @property
    def difference(self) -> Tensor:
        """Return the share with the team minus that without it, float32 [H, W]; below 0 it protects."""
        return self.with_team - self.without

    def numbers(self) -> dict[str, Any]:
        """Return what ``evaluation.json`` keeps: areas with 95 % intervals over the fires, the difference paired."""
        burned = {
            "without": self.area_without,
            "with": self.area_with,
            "difference": self.area_with - self.area_without,
        }
        return {
            "fires": self.seeds[1],
            "first_seed": self.seeds[0],
            "ground_seed": self.seeds[0],
            "horizon": self.horizon,
            "cell_size": self.cell_size,
            "burned_ha": {name: summarise(area) for name, area in burned.items()},
            "cleared_ha": summarise(self.cleared),
        }


def play_maps(run_config: RunConfig, actor: Actor, mode: str, fires: int) -> PolicyMaps:
    """Play fires on the ground of the first evaluated seed, each once without the team and once with it.

    Args:
        run_config: The scenario and the evaluation, whose ``first_seed`` is the ground's and the first fire's.
        actor: The policy.
        mode: ``sampled`` or ``deterministic``.
        fires: How many.
    """
    first = run_config.evaluation.first_seed
    source = Fixed(source=run_config.world.landscape, seed=first)
    run_config = replace(run_config, world=replace(run_config.world, landscape=source))
    at_once = max(1, min(_MOST_WORLDS, _CELLS_AT_ONCE // int(np.prod(run_config.world.size))))
    ends: dict[str, list[_End]] = {"without": [], "with": []}
    for seed in range(first, first + fires, at_once):
        env = run_config.make_env(min(at_once, first + fires - seed), seed)
        ends["without"].append(_play(env, NoOp(env), seed, "sampled"))
        ends["with"].append(_play(env, actor(env), seed, mode))
    without, together = (_joined(parts) for parts in ends.values())
    ground = source(world_key(torch.tensor([first])))
    hectares = run_config.world.side_of_cell**2 / 10_000.0
    bare = ~without.trees
    return PolicyMaps(
        ground=ground,
        cell_size=run_config.world.side_of_cell,
        seeds=(first, fires),
        horizon=run_config.world.horizon,
        without=(without.burned / fires).masked_fill(bare, torch.nan),
        with_team=(together.burned / fires).masked_fill(bare, torch.nan),
        lit=without.lit,
        area_without=without.area * hectares,
        area_with=together.area * hectares,
        cleared=together.cleared * hectares,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _End:
    """Ends of some fires: [H, W] over the fires, and [n] by fire [cells]."""

    burned: Tensor
    lit: Tensor
    trees: Tensor
    area: np.ndarray
    cleared: np.ndarray


def _play(env: WildfireEnv, policy: TensorDictModuleBase, seed: int, mode: str) -> _End:
    """Play one episode in each world."""
    lit = is_burning(env.world.reset(env.seeds, torch.zeros_like(env.seeds)).cells).any(dim=0)
    play(env, policy, seed, mode)
    state = env.shared_state
    burned = lost(state)
    return _End(
        burned=burned.sum(dim=0).cpu(),
        lit=lit.cpu(),
        trees=state.initial[0].cpu(),
        area=burned.sum(dim=(1, 2)).double().numpy(force=True),
        cleared=env.tree_counts.cleared.double().numpy(force=True),
    )


def lost(state: WorldState) -> Tensor:
    """Return the initial trees that have burned to ash or burn, bool [B, H, W]."""
    return state.initial & (state.burned | is_burning(state.cells))


def _joined(parts: list[_End]) -> _End:
    return _End(
        burned=torch.stack([each.burned for each in parts]).sum(dim=0),
        lit=torch.stack([each.lit for each in parts]).any(dim=0),
        trees=parts[0].trees,
        area=np.concatenate([each.area for each in parts]),
        cleared=np.concatenate([each.cleared for each in parts]),
    )


def write_maps(folder: Path, maps: PolicyMaps, grid: Grid | None, title: str, policy: str) -> None:
    """Write the maps as GeoTIFF, on the landscape's grid where it has one, and as ``maps.png``.

    Args:
        folder: Folder of the files.
        maps: The maps.
        grid: The grid that the ground is a window of; None writes metres from the south-west corner.
        title: Title of the figure.
        policy: The policy's name.

    Raises:
        ValueError: If rasterio is not installed.
        OSError: If a write fails, with the path.
    """
    shape, corner = tuple(maps.without.shape), maps.ground.corner
    grid, place = (
        (local_grid((shape[0], shape[1]), maps.cell_size), (0, 0))
        if grid is None
        else (grid, (0, 0) if corner is None else (int(corner[0, 0]), int(corner[0, 1])))
    )
    layers = {"without": maps.without, "with": maps.with_team, "difference": maps.difference}
    for name, layer in layers.items():
        write_geotiff(folder / f"burn_probability_{name}.tif", {f"burn_probability_{name}": layer}, grid, place)
    panels = _panels(maps, policy)
    with disk.with_path(folder / "maps.png"):
        save_maps(folder / "maps.png", maps.ground, panels, maps.cell_size, title, maps.lit)


def _panels(maps: PolicyMaps, policy: str) -> list[MapPanel]:
    means = [float(area.mean()) for area in (maps.area_without, maps.area_with)]
    names = ["without the team", f"with it: {policy}"]
    chances = [
        MapPanel(title=f"{name}, {mean:.3g} ha burned", values=values, label="burn probability")
        for name, mean, values in zip(names, means, (maps.without, maps.with_team))
    ]
    label = "difference of burn probability; blue: the team protects"
    change = MapPanel(
        title=f"with it - without it, {means[1] - means[0]:+.3g} ha", values=maps.difference, label=label, kind="change"
    )
    return [*chances, change]


def maps_line(numbers: Mapping[str, Any]) -> str:
    """Return the numbers of maps as a line for the terminal."""
    areas = []
    for name, area in numbers["burned_ha"].items():
        mean, (low, high) = area["mean"], area["ci95"]
        sign = "+" if name == "difference" else ""
        areas.append(f"{mean:{sign}.2f} ({low:{sign}.2f} .. {high:{sign}.2f})")
    return (
        f"maps: {numbers['fires']} fires on the ground of seed {numbers['ground_seed']}: {areas[0]} ha burn without "
        f"the team, {areas[1]} ha with it, a difference of {areas[2]} ha"
    )
