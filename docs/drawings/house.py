"""Figure of the house: the rooms of the package on their floors, from the imports of its files."""

import ast
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING

import warp_torchrl
from warp_torchrl.env.pictures.drawing import BLUE, INK, SOFT, sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PACKAGE = Path(warp_torchrl.__file__).parent
_HEIGHT, _GAP = 0.62, 0.12  # of a room, and between two of a floor, in floors


def house() -> "Figure":
    """Rooms of the package and of its world on their floors: a room stands above all that it imports."""
    figure, axes = sheet([["package", "world"]], (9.6, 5.6), "The house: each room stands above all that it imports")
    for name, folder in (("package", PACKAGE), ("world", PACKAGE / "world")):
        _draw(axes[name], *rooms_of(folder))
        axes[name].set_title("warp_torchrl" if name == "package" else "warp_torchrl/world")
    return figure


def rooms_of(folder: Path) -> tuple[dict[str, int], dict[str, set[str]]]:
    """Return the rooms of a folder, its folders and files, with their lines, and the rooms that each imports."""
    prefix = ".".join((PACKAGE.name, *folder.relative_to(PACKAGE).parts))
    lines: dict[str, int] = defaultdict(int)
    needs: dict[str, set[str]] = defaultdict(set)
    for path in folder.rglob("*.py"):
        room = path.relative_to(folder).parts[0].removesuffix(".py")
        if room.startswith("__"):
            continue
        text = path.read_text(encoding="utf-8")
        lines[room] += len(text.splitlines())
        for node in ast.walk(ast.parse(text)):
            named = getattr(node, "module", None) or ""
            words = named.removeprefix(prefix).split(".") if f"{named}.".startswith(f"{prefix}.") else [""]
            if isinstance(node, ast.ImportFrom) and len(words) > 1 and words[1] != room:
                needs[room].add(words[1])
    return dict(lines), {room: needs[room] & lines.keys() for room in lines}


def floors_of(needs: dict[str, set[str]]) -> dict[str, int]:
    """Return the floor of each room: one above the highest that it imports, from 0."""
    floors: dict[str, int] = {}

    def floor(room: str) -> int:
        if room not in floors:
            floors[room] = 1 + max(map(floor, needs[room]), default=-1)
        return floors[room]

    for room in needs:
        floor(room)
    return floors


def _draw(axes: "Axes", lines: dict[str, int], needs: dict[str, set[str]]) -> None:
    from matplotlib.patches import FancyBboxPatch

    floors = floors_of(needs)
    middles = {}
    for level in range(max(floors.values()) + 1):
        there = sorted((room for room, floor in floors.items() if floor == level), key=lambda room: -lines[room])
        widths = [0.75 + 0.11 * len(room) + (lines[room] / 2500.0) ** 0.5 for room in there]
        left = -(sum(widths) + _GAP * (len(widths) - 1)) / 2.0
        for room, width in zip(there, widths):
            middles[room] = (left + width / 2.0, level)
            box = FancyBboxPatch(
                (left, level - _HEIGHT / 2.0), width, _HEIGHT, boxstyle="round,pad=0,rounding_size=0.08",
                facecolor="#eef3f8", edgecolor=BLUE, linewidth=0.8, zorder=2,
            )  # fmt: skip
            axes.add_patch(box)
            axes.text(*middles[room], room, ha="center", va="bottom", fontsize=7.5, color=INK, zorder=3)
            told = f"{lines[room]:,} lines"
            axes.text(*middles[room], told, ha="center", va="top", fontsize=5.5, color=SOFT, zorder=3)
            left += width + _GAP
    for room, others in needs.items():
        for other in others - {below for each in others for below in _below(each, needs)}:  # else by way of another
            (x, y), (to_x, to_y) = middles[room], middles[other]
            ends = ((x, to_x), (y - _HEIGHT / 2.0, to_y + _HEIGHT / 2.0))
            axes.plot(*ends, color="#b8b8b8", linewidth=0.8, zorder=1)
    axes.set(ylim=(-0.6, max(floors.values()) + 0.6), xticks=[], yticks=[])
    axes.margins(x=0.03)
    for side in axes.spines.values():
        side.set_visible(False)


def _below(room: str, needs: dict[str, set[str]]) -> set[str]:
    """Return all that a room stands on."""
    return set().union(*({each} | _below(each, needs) for each in needs[room]))
