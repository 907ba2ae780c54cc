"""Shared parts of the figures: sheets, palettes, maps, scale bars, wind arrows and legends.

Matplotlib is imported here alone, and only when something is drawn. A map has its axes in kilometres, north up.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from PIL import Image
from torch import Tensor

from warp_torchrl.env.pictures.colours import ASH, FIRE, GROUND
from warp_torchrl.env.pictures.render import render
from warp_torchrl.system import disk
from warp_torchrl.world.state.state import Cover, Landscape, WorldState

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, SOFT, GRID = "#222222", "#666666", "#d9d9d9"
BLUE, ORANGE, VERMILION, SKY, PURPLE = "#0072B2", "#E69F00", "#D55E00", "#56B4E9", "#CC79A7"  # Okabe and Ito 2008
COVER_COLOURS = {  # of different lightness: distinct in grey and with colour blindness
    Cover.LAKE: (24, 58, 116),
    Cover.WETLAND: (112, 172, 196),
    Cover.GRASSLAND: (240, 226, 160),
    Cover.FOREST: (74, 128, 88),
    Cover.BARE: (176, 172, 178),
}
CELL = 30.0
"""Side of a cell of the maps that are drawn from noise [m]."""
_DPI = 130
_LARGEST = 250_000  # bytes; git keeps every version of a figure
_STYLE = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.labelsize": 8.0,
    "axes.edgecolor": SOFT,
    "axes.linewidth": 0.7,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "figure.titlesize": 9.5,
    "contour.negative_linestyle": "solid",
}


def sheet(
    layout: str | Sequence[Sequence[str]], size: tuple[float, float], title: str, **ratios: Any
) -> tuple["Figure", dict[str, "Axes"]]:
    """Return an empty figure and its axes by name.

    Args:
        layout: As for ``Figure.subplot_mosaic``.
        size: (width, height) [inches].
        title: What is seen.
        ratios: ``width_ratios`` and ``height_ratios`` of the layout.
    """
    from matplotlib.figure import Figure  # a figure without pyplot needs no display

    figure = Figure(figsize=size, dpi=_DPI, layout="constrained")
    figure.get_layout_engine().set(w_pad=0.07, h_pad=0.06)
    axes = figure.subplot_mosaic(layout, **ratios)
    figure.suptitle(title)
    return figure, axes


@contextmanager
def style() -> Iterator[None]:
    """Draw with our Matplotlib settings instead of the user's."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        yield


def ramp(name: str, low: float, high: float) -> Any:
    """Return the part of a Matplotlib colour map between two places in 0..1."""
    import matplotlib
    from matplotlib.colors import ListedColormap

    return ListedColormap(matplotlib.colormaps[name](np.linspace(low, high, 256)))


def save_figure(figure: "Figure", path: Path, largest: int | None = _LARGEST) -> None:
    """Write a PNG, the same bytes for the same figure and Matplotlib.

    Args:
        figure: The figure.
        path: The file.
        largest: It has 256 colours where it would be larger than that [bytes]; None keeps all colours.
    """
    drawn = BytesIO()
    figure.savefig(drawn, format="png", dpi=_DPI)
    image = Image.open(drawn).convert("RGB")
    if largest is not None and len(drawn.getvalue()) > largest:
        image = image.quantize(256, kmeans=2, dither=Image.Dither.NONE)
    with disk.drafted(path) as draft:
        image.save(draft, "PNG", optimize=True, dpi=(_DPI, _DPI))


# Maps


def show_map(axes: "Axes", image: Tensor | np.ndarray, cell_size: float = CELL, **options: Any) -> Any:
    """Show a map [H, W] or [H, W, 3] with a scale bar and no ticks; return Matplotlib's image."""
    height, width = image.shape[:2]
    east, north = width * cell_size / 1000.0, height * cell_size / 1000.0
    pixels = image.numpy() if isinstance(image, Tensor) else image
    shown = axes.imshow(pixels, extent=(0.0, east, 0.0, north), interpolation="nearest", **options)
    axes.set_xticks([])
    axes.set_yticks([])
    scale_bar(axes, east)
    return shown


def axis_places(size: int, cell_size: float = CELL, descending: bool = False) -> np.ndarray:
    """Return where the middles of a map's columns lie on its axes, or of its rows (descending) [km]."""
    middle = (np.arange(size) + 0.5) * cell_size / 1000.0
    return middle[::-1] if descending else middle


def contours(axes: "Axes", plane: Tensor, cell_size: float = CELL, **options: Any) -> Any:
    """Draw contour lines of a plane [H, W] over a map."""
    height, width = plane.shape
    return axes.contour(
        axis_places(width, cell_size), axis_places(height, cell_size, True), np.asarray(plane), **options
    )


def scale_bar(axes: "Axes", width: float) -> None:
    """Draw a bar of a round length, about a fifth of the map's width [km], in its lower left corner."""
    from matplotlib.patheffects import withStroke

    length = round_length(width / 4.0)
    name = f"{length:g} km" if length >= 1.0 else f"{1000.0 * length:g} m"
    halo = [withStroke(linewidth=2.5, foreground="white")]
    start = 0.04 * width
    axes.plot(
        [start, start + length], [start, start], color=INK, linewidth=2.0, solid_capstyle="butt",
        path_effects=[withStroke(linewidth=4.0, foreground="white")],
    )  # fmt: skip
    axes.text(
        start + length / 2.0, start * 1.4, name, ha="center", va="bottom", fontsize=7.0, path_effects=halo, color=INK
    )


def wind_arrow(axes: "Axes", u: float, v: float, place: tuple[float, float] = (0.88, 0.88)) -> None:
    """Draw the wind (u east, v north) [m/s] as an arrow where the air goes, with its speed, in axes' coordinates."""
    from matplotlib.patheffects import withStroke

    speed = math.hypot(u, v)
    x, y, half = *place, 0.07
    step = (half * u / speed, half * v / speed)
    arrow = {"arrowstyle": "-|>,head_width=0.28,head_length=0.5", "linewidth": 1.6, "color": INK}
    arrow["path_effects"] = [withStroke(linewidth=3.5, foreground="white")]
    axes.annotate(
        "", (x + step[0], y + step[1]), (x - step[0], y - step[1]), "axes fraction", "axes fraction", arrowprops=arrow
    )
    axes.text(
        x, y - 0.035 - abs(step[1]), f"{speed:g} m/s", transform=axes.transAxes, ha="center", va="top", fontsize=7.0,
        path_effects=[withStroke(linewidth=2.5, foreground="white")],
    )  # fmt: skip


def relief(ground: Landscape) -> Tensor:
    """Return the elevation of world 0, float32 [H, W] [m].

    Raises:
        ValueError: If the worlds are flat.
    """
    if ground.elevation is None:
        raise ValueError("landscape must have an elevation to draw, got a flat one")
    return ground.elevation[0]


def hillshade(elevation: Tensor, cell_size: float = CELL, exaggeration: float = 1.0) -> Tensor:
    """Return how light the ground is under a sun in the north-west, 45 degrees high; float32 [H, W] in 0..1.

    Lambert's cosine law; level ground has 0.71.
    """
    southward, eastward = torch.gradient(elevation * (exaggeration / cell_size))
    towards_sun = (eastward + southward) * 0.5 + math.sqrt(0.5)
    return (towards_sun / torch.sqrt(1.0 + eastward.square() + southward.square())).clamp(0.0, 1.0)


def cover_image(cover: Tensor, light: Tensor | None = None) -> Tensor:
    """Return the colours of land cover [H, W], shaded by ``hillshade`` where given, float32 [H, W, 3] in 0..1."""
    table = torch.tensor([COVER_COLOURS[code] for code in Cover], dtype=torch.float32) / 255.0
    image = table[cover.to(torch.int64)]
    return image if light is None else (image * (0.55 + 0.64 * light)[..., None]).clamp(max=1.0)


def round_length(length: float) -> float:
    """Return the largest of 1, 2, 5 x 10^n that is not longer, in the unit given."""
    power = 10.0 ** math.floor(math.log10(length))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= length * 1.0001)


# Legends


def cover_legend(figure: "Figure", covers: Sequence[Cover], marks: dict[str, dict[str, Any]]) -> None:
    """Write below a figure the meaning of its colours of land cover, lines and marks.

    Args:
        figure: The figure.
        covers: Those to name.
        marks: Matplotlib's properties of each kind of line or mark, by what it means.
    """
    from matplotlib.patches import Patch

    handles = [Patch(color=np.divide(COVER_COLOURS[code], 255.0), label=code.name.lower()) for code in covers]
    line_legend(figure, marks, handles)


def line_legend(figure: "Figure", lines: dict[str, dict[str, Any]], before: Sequence[Any] = ()) -> None:
    """Write below a figure the meaning of its lines, by Matplotlib's properties of each."""
    from matplotlib.lines import Line2D

    handles = [*before, *(Line2D([], [], label=name, **look) for name, look in lines.items())]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles) if len(handles) < 6 else 4)


def fire_image(state: WorldState) -> np.ndarray:
    """Return the colours of one world, those of its recordings, uint8 [H, W, 3]."""
    return render(state, None, scale=1)[0].numpy()


def fire_legend(
    figure: "Figure", covers: Sequence[Cover] = (Cover.FOREST,), lines: dict[str, Any] | None = None
) -> None:
    """Write below a figure the meaning of the colours of ``fire_image``, and of its lines and arrows.

    Args:
        figure: The figure.
        covers: Covers of its worlds; trees get darker with their age, from 1 to 10.
        lines: Matplotlib's properties of each kind of line, by its meaning.
    """
    from matplotlib.legend_handler import HandlerTuple
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    def strip(colours: Iterable[Sequence[float] | np.ndarray]) -> tuple[Patch, ...]:
        return tuple(Patch(facecolor=np.divide(colour, 255.0), edgecolor="none") for colour in colours)

    entries = {}
    for cover in covers:
        youngest, oldest = np.array(GROUND[cover][1:])
        one_colour = cover in (Cover.LAKE, Cover.BARE)
        name = cover.name.lower() if one_colour else f"{cover.name.lower()}, age 1 to 10"
        entries[name] = strip([youngest] if one_colour else np.linspace(youngest, oldest, 5))
    entries |= {"fire, stages 1 to 5": strip(FIRE), "ash": strip([ASH])}
    entries |= {name: Line2D([], [], **look) for name, look in (lines or {}).items()}
    figure.legend(
        list(entries.values()), list(entries), loc="outside lower center", ncols=3,
        handler_map={tuple: HandlerTuple(ndivide=None, pad=0.0)}, handlelength=3.0,
    )  # fmt: skip


def line_style(index: int) -> dict[str, Any]:
    """Return the colour and the dashes of line number ``index`` of a figure."""
    colours = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#56B4E9", "#CC79A7", "#555555", "#F0E442")  # Okabe, Ito
    dashes = ("-", "--", "-.", ":")
    return {"color": colours[index % len(colours)], "linestyle": dashes[index // len(colours) % len(dashes)]}
