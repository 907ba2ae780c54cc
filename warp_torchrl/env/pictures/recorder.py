"""An episode as an animation: the map, and beside it the numbers, the wind and a legend."""

import math
import os
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFont
from torch import Tensor
from torch.nn.functional import adaptive_max_pool2d, interpolate

from warp_torchrl.env.pictures.colours import (
    AGENT,
    AGES,
    ASH_ROW,
    FIRE_ROW,
    FIREBREAK_ROW,
    HOUSE,
    INK,
    LINE,
    LOST,
    PAPER,
    SOFT,
    WET_ROW,
    colour_table,
)
from warp_torchrl.env.pictures.render import ground_colours, render, stamp, with_buildings
from warp_torchrl.world.state.cells import count_trees
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.state.state import Cover, WorldState
from warp_torchrl.world.team.presence import on_scene

_MAP_SIDE, _PANEL, _COLUMN, _MARGIN = 384, (216, 384), 112, 12  # [pixels]
_MOST_FRAMES, _FRAME_MS, _LAST_FRAME_MS = 130, 120, 2000  # 130: an episode of 256 steps keeps every second frame
_font = lru_cache(maxsize=16)(ImageFont.load_default)


class EpisodeRecorder:
    """Collects an episode frame by frame: the map, and beside it the numbers, the wind and a legend.

    Args:
        title: Heading of the panel, such as the scenario; what follows a line break stands smaller below it.
        roles: Role of each agent, as ``Team.agent_roles``.
        buildings: ``World.buildings``; None draws none.
    """

    def __init__(
        self, title: str, roles: Sequence[str], buildings: Callable[[WorldState], Tensor | None] = lambda state: None
    ):
        self._title, self._buildings = title, buildings
        self._flies = torch.tensor([ROLES[role].flies for role in roles])
        self._frames: list[Image.Image] = []
        self._seen, self._stride = 0, 1

    def add(self, state: WorldState) -> None:
        """Append world 0 of a batch; of a long episode an even sample stays, and always its newest frame."""
        if (self._seen - 1) % self._stride > 0:
            self._frames.pop()
        self._frames.append(self.frame(state).quantize(palette=_gif_palette(), dither=Image.Dither.NONE))
        self._seen += 1
        if len(self._frames) > _MOST_FRAMES:
            self._frames, self._stride = self._frames[::2], 2 * self._stride

    def frame(self, state: WorldState) -> Image.Image:
        """Return the picture of world 0 of a batch, RGB."""
        state = state[:1]
        buildings = self._buildings(state)
        picture = Image.fromarray(_fitted_map(state, self._flies, buildings))
        roles = tuple(self._flies.to(torch.int64).unique().tolist())
        panel = _legend(self._title, roles, buildings is not None).copy()
        _draw_numbers(panel, state)
        _draw_wind(panel, *state.wind.mean((0, 2, 3)).tolist())
        height = max(panel.height, picture.height)
        canvas = Image.new("RGB", (picture.width + panel.width + 3 * _MARGIN, height + 2 * _MARGIN), PAPER)
        canvas.paste(picture, (_MARGIN, _MARGIN + (height - picture.height) // 2))
        canvas.paste(panel, (picture.width + 2 * _MARGIN, _MARGIN + (height - panel.height) // 2))
        return canvas

    def frames(self) -> list[tuple[Image.Image, int]]:
        """Return each frame, with a palette, and its duration [ms]; at most 130.

        Raises:
            ValueError: If no frame was added.
        """
        if not self._frames:
            raise ValueError("an episode needs at least one frame, got none")
        return [(frame, _FRAME_MS) for frame in self._frames[:-1]] + [(self._frames[-1], _LAST_FRAME_MS)]

    def save(self, path: str | Path) -> None:
        """Write a looping GIF of at most 130 frames; the file appears whole or not at all.

        Raises:
            ValueError: If no frame was added.
        """
        (first, *rest), durations = zip(*self.frames())
        partial = Path(path).with_name(f".{Path(path).name}.{os.getpid()}.partial")
        try:
            first.save(partial, "GIF", save_all=True, append_images=rest, loop=0, duration=list(durations))
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)


def _fitted_map(state: WorldState, flies: Tensor, buildings: Tensor | None) -> np.ndarray:
    """Return the map of one world with its longer side near 384 pixels, uint8 [h, w, 3]; a large one is averaged."""
    flies, (height, width) = flies.to(state.cells.device), state.cells.shape[1:]
    shrink = max(height, width) / _MAP_SIDE
    if shrink <= 1.5:
        return render(state, flies, max(1, round(1 / shrink)), buildings)[0].cpu().numpy()
    colours = ground_colours(state).movedim(3, 1).float()
    size = math.ceil(height / shrink), math.ceil(width / shrink)
    image = interpolate(colours, size, mode="area").round().byte().movedim(1, 3)
    if buildings is not None:
        image = with_buildings(image, adaptive_max_pool2d(buildings, size), 1)
    place = (state.vehicles.position / shrink).long()
    return stamp(image, place, flies.long(), 1, on_scene(state))[0].cpu().numpy()


@lru_cache(maxsize=1)
def _gif_palette() -> Image.Image:
    """Return the one palette of all frames: every colour of the map and the agents, and 48 shades of text."""
    shades = np.linspace(PAPER, INK, 48).round()
    colours = np.concatenate((colour_table(torch.device("cpu")), np.reshape(AGENT, (-1, 3)), shades))
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours.astype(int).flatten().tolist())
    return palette


def _write(panel: Image.Image, place: tuple[int, int], text: str, size: int, colour: tuple[int, int, int]) -> None:
    """Write a line, its middle left at ``place``; smaller, then cut short, where it would leave the panel."""
    room = _PANEL[0] - place[0]
    font = _font(min(size, max(13, int(size * room / max(1.0, _font(size).getlength(text))))))
    while font.getlength(text) > room:
        text = text.removesuffix("...")[:-1].rstrip() + "..."
    ImageDraw.Draw(panel).text(place, text, colour, font, anchor="lm")


@lru_cache(maxsize=8)
def _legend(title: str, roles: tuple[int, ...], has_buildings: bool) -> Image.Image:
    """Return the constant part of the panel: title and legend."""
    top = 246 if has_buildings else 262
    panel = Image.new("RGB", _PANEL, PAPER)
    for line, y, size, colour in zip(title.splitlines(), (9, 36), (22, 15), (INK, SOFT)):
        _write(panel, (0, y), line, size, colour)
    table = colour_table(torch.device("cpu")).numpy()
    trees = table[:FIRE_ROW].reshape(len(Cover), AGES, 3)
    fire, ember, ash, firebreak = np.split(table[FIRE_ROW:WET_ROW], [4, 5, 6])
    left = {cover.name.capitalize(): trees[cover, 1:] for cover in list(Cover)[: Cover.BARE]}
    left |= {"No tree": trees[1:, 0], "Wet": table[WET_ROW + AGES : WET_ROW + 4 * AGES : 8]}
    right = {"Fire": fire, "Ember": ember, "Ash": ash, "Firebreak": firebreak}
    left |= {"House": np.array([HOUSE, LOST], dtype=np.uint8)} if has_buildings else {}
    for x, entries in ((0, left), (_COLUMN, right)):
        for y, (name, colours) in zip(range(top, 400, 20), entries.items()):
            _paste_strip(panel, colours, x, y, 30, 15)
            _write(panel, (x + 38, y + 7), name, 13, INK)
    for y, role in zip((top + 80, top + 100), roles):
        ground = torch.tensor(PAPER, dtype=torch.uint8).expand(1, 15, 31, 3)
        glyph = stamp(ground, torch.tensor([[[7, 15]]]), torch.tensor([role]))[0].numpy()
        panel.paste(Image.fromarray(glyph), (_COLUMN, y))
        _write(panel, (_COLUMN + 38, y + 7), ("Bulldozer", "UAV")[role], 13, INK)
    return panel


def _paste_strip(panel: Image.Image, colours: np.ndarray, x: int, y: int, width: int, height: int) -> None:
    """Paste colours, uint8 [n, 3], side by side, with a thin frame around them."""
    panel.paste(Image.fromarray(colours[None]).resize((width, height), Image.Resampling.NEAREST), (x, y))
    ImageDraw.Draw(panel).rectangle((x, y, x + width - 1, y + height - 1), outline=LINE)


def _draw_numbers(panel: Image.Image, state: WorldState) -> None:
    """Write the clock and the share of the trees, and draw what became of the trees as a bar."""
    counts = count_trees(state)
    fates = torch.stack((counts.preserved + counts.extinguished, counts.burning, counts.cleared), dim=1)
    share = (fates[0] / counts.initial).cpu()
    clock = (("Step", f"{int(state.step)}"), ("Fire tick", f"{int(state.tick)}"))
    for place, (name, value) in enumerate((*clock, ("Saved", f"{share[0]:.1%}"), ("Burning", f"{share[1]:.1%}"))):
        x, y = _COLUMN * (place % 2), 69 + 46 * (place // 2)
        _write(panel, (x, y), name, 13, SOFT)
        _write(panel, (x, y + 19), value, 22, INK)
    fate = torch.bucketize((torch.arange(_PANEL[0]) + 0.5) / _PANEL[0], share.cumsum(0))
    rows = torch.tensor([Cover.FOREST * AGES + 4, FIRE_ROW + 2, FIREBREAK_ROW, ASH_ROW])
    _paste_strip(panel, colour_table(torch.device("cpu"))[rows[fate]].numpy(), 0, 157, _PANEL[0], 12)


def _draw_wind(panel: Image.Image, u: float, v: float) -> None:
    """Draw the mean wind (u east, v north) [m/s] as an arrow in a ring that points where the air goes."""
    speed = math.hypot(u, v)
    dial = Image.new("RGB", (232, 232), PAPER)  # four times its size, for smooth edges
    draw = ImageDraw.Draw(dial)
    draw.ellipse((2, 2, 229, 229), outline=LINE, width=7)
    if speed >= 0.05:
        east, south = u / speed, -v / speed
        arrow = ((84, 0), (20, 34), (20, 8), (-78, 8), (-78, -8), (20, -8), (20, -34))
        draw.polygon([(116 + a * east - b * south, 116 + a * south + b * east) for a, b in arrow], INK)
    panel.paste(dial.reduce(4), (0, 184))
    _write(panel, (_COLUMN - 30, 203), "Wind", 13, SOFT)
    _write(panel, (_COLUMN - 30, 222), f"{speed:.1f} m/s" if speed >= 0.05 else "calm", 22, INK)
