"""Maps as one figure: panels over paled ground, with scale bars, colour bars and the ignition."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.env.pictures.drawing import (
    axis_places,
    contours,
    cover_image,
    cover_legend,
    hillshade,
    ramp,
    round_length,
    save_figure,
    sheet,
    show_map,
    style,
)
from warp_torchrl.world.state.state import Cover, Landscape
from warp_torchrl.world.terrain.geotiff import as_array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SIDE = 3.5  # of a panel's longer side [inches]
_RELIEF = {"color": "black", "linewidth": 0.4, "alpha": 0.5}
_OUTLINE = {"color": "black", "linewidth": 1.2, "linestyle": "--"}
_STAR = {"marker": "*", "color": "white", "markeredgecolor": "black", "markersize": 11, "linestyle": "none"}
_SMALL = 0.06  # share of the map's side below which an ignition is marked by a star


@dataclass(frozen=True, kw_only=True, eq=False)
class MapPanel:
    """One map of a figure.

    Attributes:
        title: Title of the map.
        values: float [H, W]; NaN shows the ground.
        label: Quantity of the colours, with its unit.
        kind: ``chance`` runs from 0 to 1; ``change`` from blue, less, over white to red, more; ``amount`` from 0 to
            the largest value. Where a chance or a change is 0, the ground shows.
        top: Largest value of the colour scale; None is the largest of the map.
    """

    title: str
    values: Tensor | np.ndarray
    label: str
    kind: Literal["chance", "change", "amount"] = "chance"
    top: float | None = None


def draw_maps(
    ground: Landscape,
    panels: Sequence[MapPanel],
    cell_size: float,
    title: str,
    ignition: Tensor | np.ndarray | None = None,
) -> "Figure":
    """Return a figure of the ground, with contours and ignition, and of maps beside it; call it within ``style``.

    Args:
        ground: Its first world is drawn.
        panels: The maps, [H, W] of the ground.
        cell_size: Side of a cell [m].
        title: Of the figure.
        ignition: Cells where fire starts, bool [H, W]; one small patch is marked by a star.
    """
    height, width = ground.cover.shape[1:]
    names = ["ground", *(f"{number}" for number in range(len(panels)))]
    columns = 2 if len(names) in (2, 4) else min(3, len(names))
    rows = [[*names[start : start + columns]] for start in range(0, len(names), columns)]
    rows[-1] += ["."] * (columns - len(rows[-1]))
    side = _SIDE / max(height, width)
    size = (columns * max(1.6, side * width) + 0.3, len(rows) * (max(1.6, side * height) + 0.85) + 0.7)
    figure, axes = sheet(rows, size, title)
    marks = _draw_ground(axes["ground"], ground, cell_size)
    for name, panel in zip(names[1:], panels, strict=True):
        _draw_panel(figure, axes[name], ground, panel, cell_size)
    for each in axes.values():
        each.set_anchor("N")  # the ground has no colour bar, and stands in line with maps that have one
    if ignition is not None:
        for each in axes.values():
            look = _mark_ignition(each, as_array(ignition), cell_size)
        marks |= {"ignition": look} if as_array(ignition).any() else {}
    covers = [code for code in Cover if bool((ground.cover[0] == int(code)).any())]
    cover_legend(figure, covers, marks)
    return figure


def save_maps(path: Path, *arguments: Any, **options: Any) -> None:
    """Draw maps as ``draw_maps`` does, and write them as a PNG.

    Raises:
        ImportError: If Matplotlib is not installed.
    """
    with style():
        save_figure(draw_maps(*arguments, **options), path, largest=None)


def _light(ground: Landscape, cell_size: float) -> Tensor | None:
    return None if ground.elevation is None else hillshade(ground.elevation[0].cpu(), cell_size)


def _draw_ground(axes: "Axes", ground: Landscape, cell_size: float) -> dict[str, dict[str, Any]]:
    """Draw land cover and relief; return the look of its lines by what they mean."""
    show_map(axes, cover_image(ground.cover[0].cpu(), _light(ground, cell_size)), cell_size)
    axes.set_title("land cover")
    if ground.elevation is None:
        return {}
    elevation = ground.elevation[0].cpu()
    low, high = (float(bound) for bound in elevation.aminmax())
    step = round_length(max(8.0, high - low) / 8.0)
    levels = np.arange(ceil(low / step), high // step + 1) * step
    if len(levels):
        contours(axes, elevation, cell_size, levels=levels, colors="black", linewidths=0.35, alpha=0.6)
    axes.set_title(f"land cover and relief, {low:.0f} to {high:.0f} m")
    return {f"contours every {step:g} m": _RELIEF} if len(levels) else {}


def _draw_panel(figure: "Figure", axes: "Axes", ground: Landscape, panel: MapPanel, cell_size: float) -> None:
    """Draw a map over the paled ground, with its colour bar."""
    backdrop = 0.35 * cover_image(ground.cover[0].cpu(), _light(ground, cell_size)) + 0.65
    show_map(axes, backdrop.clamp(max=1.0), cell_size)
    values = as_array(panel.values).astype(np.float64)
    hidden = ~np.isfinite(values) | ((values == 0.0) & (panel.kind != "amount"))
    largest = float(np.abs(values[~hidden]).max()) if not hidden.all() else 1.0
    top = largest if panel.top is None else panel.top
    colours, low, high = {
        "chance": (ramp("plasma_r", 0.0, 0.95), 0.0, 1.0),
        "change": ("RdBu_r", -top, top),
        "amount": (ramp("viridis_r", 0.05, 1.0), 0.0, top),
    }[panel.kind]
    seen = np.ma.masked_array(values, hidden)
    image = axes.imshow(seen, extent=axes.images[0].get_extent(), cmap=colours, vmin=low, vmax=high, alpha=0.85)
    extend = "neither" if largest <= high else "both" if panel.kind == "change" else "max"
    figure.colorbar(image, ax=axes, label=panel.label, location="bottom", shrink=0.85, pad=0.02, extend=extend)
    axes.set_title(panel.title)


def _mark_ignition(axes: "Axes", lit: np.ndarray, cell_size: float) -> dict[str, Any]:
    """Mark where fire starts, by a star or an outline; return the look of the mark."""
    if not lit.any():
        return _STAR
    rows, columns = np.nonzero(lit)
    height, width = lit.shape
    if max(np.ptp(rows) + 1, np.ptp(columns) + 1) <= max(3.0, _SMALL * max(height, width)):
        middle = int(rows.mean().round()), int(columns.mean().round())
        axes.plot(axis_places(width, cell_size)[middle[1]], axis_places(height, cell_size, True)[middle[0]], **_STAR)
        return _STAR
    look = {"colors": _OUTLINE["color"], "linewidths": 1.2, "linestyles": "dashed"}
    contours(axes, torch.from_numpy(without_holes(lit).astype(np.float32)), cell_size, levels=[0.5], **look)
    return _OUTLINE


def without_holes(area: np.ndarray) -> np.ndarray:
    """Return an area with the cells that have cells of it on all four sides, bool [H, W].

    Water and bare cells between ignitions are many, and their outlines would hide the map.
    """
    between = [
        np.maximum.accumulate(area, axis) & np.flip(np.maximum.accumulate(np.flip(area, axis), axis), axis)
        for axis in (0, 1)
    ]
    return between[0] & between[1]
