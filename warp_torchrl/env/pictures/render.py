"""Pictures: worlds as images, and an episode as an animation with a legend."""

import math
import os
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFont
from torch import Tensor
from torch.nn.functional import interpolate

from warp_torchrl.system.modes import kept
from warp_torchrl.world.state.cells import count_trees, is_burning
from warp_torchrl.world.state.records import freshness, records_of
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.state.state import EMPTY, FIRST_FIRE, OLDEST, Cover, WorldState
from warp_torchrl.world.team.presence import on_scene

# The fire front, 11..13, is lighter than any ground; 14 stays 16 units of CIE Lab off without the red or green cone.
_GROUND = {  # without a tree, youngest tree, oldest tree
    Cover.LAKE: ((34, 76, 142),) * 3,
    Cover.WETLAND: ((118, 140, 144), (92, 134, 138), (52, 98, 108)),
    Cover.GRASSLAND: ((152, 146, 124), (140, 154, 100), (96, 124, 72)),
    Cover.FOREST: ((132, 124, 110), (88, 126, 92), (36, 82, 62)),
    Cover.BARE: ((140, 136, 144),) * 3,
}
_FIRE = ((255, 246, 120), (255, 198, 44), (255, 138, 34), (226, 42, 26), (136, 16, 48))
_ASH, _FIREBREAK, _WATER = (40, 38, 42), (230, 204, 168), (84, 196, 255)
_AGENT = (((255, 255, 255), (124, 30, 190)), ((16, 18, 24), (90, 236, 255)))  # each role's outline and body
_AGES, _FIRE_ROW, _ASH_ROW, _FIREBREAK_ROW, _WET_ROW, _FOG_ROW = 11, 55, 60, 61, 62, 124  # in the colour table
_LATELY = 0.5  # freshness of what was seen 16 steps ago, from which a cell is in fog
_MAP_SIDE, _PANEL, _COLUMN, _MARGIN = 384, (216, 384), 112, 12  # [pixels]
_PAPER, _INK, _SOFT, _LINE = (24, 27, 32), (240, 241, 243), (168, 170, 174), (98, 101, 105)
_MOST_FRAMES, _FRAME_MS, _LAST_FRAME_MS = 130, 120, 2000  # 130: an episode of 256 steps keeps every second frame
_font = lru_cache(maxsize=16)(ImageFont.load_default)


def render(state: WorldState, flies: Tensor | None, scale: int = 12) -> Tensor:
    """Draw each world.

    Args:
        state: The worlds, batch size [B].
        flies: Which agents are aircraft, bool [A]; None leaves the agents out.
        scale: Side of a cell [pixels].

    Returns:
        uint8 [B, H * scale, W * scale, 3], on the state's device.

    Raises:
        ValueError: If the scale is below 1.
    """
    if scale < 1:
        raise ValueError(f"scale must be at least 1 pixel, got {scale}")
    return painted(ground_colours(state), state, flies, scale)


def painted(colours: Tensor, state: WorldState, flies: Tensor | None, scale: int) -> Tensor:
    """Return ``render`` of worlds whose cells have other colours, uint8 [B, H, W, 3]."""
    image = colours.repeat_interleave(scale, dim=1).repeat_interleave(scale, dim=2)
    owner = state.plane("agencies", "owner")
    if owner is not None:
        image = _with_borders(image, owner.repeat_interleave(scale, dim=1).repeat_interleave(scale, dim=2))
    if flies is None:
        return image
    return _stamp(image, state.vehicles.position * scale + scale // 2, flies.to(torch.int64), scale, on_scene(state))


def fire_colours() -> Tensor:
    """Return the colours of the burning stages, the first one first, uint8 [5, 3]."""
    return torch.tensor(_FIRE, dtype=torch.uint8)


def legend_colours() -> dict[str, tuple[int, int, int]]:
    """Return a colour of each item that is drawn on a map, by its name."""
    covers = {cover.name.lower(): _GROUND[cover][-1] for cover in Cover}
    return {**covers, "fire": _FIRE[2], "ember": _FIRE[4], "ash": _ASH, "firebreak": _FIREBREAK, "wet": _WATER}


class EpisodeRecorder:
    """Collects an episode frame by frame: the map, and beside it the numbers, the wind and a legend.

    Args:
        title: Heading of the panel, such as the scenario; what follows a line break stands smaller below it.
        roles: Role of each agent, as ``Team.agent_roles``.
    """

    def __init__(self, title: str, roles: Sequence[str]):
        self._title = title
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
        picture = Image.fromarray(_fitted_map(state, self._flies))
        panel = _legend(self._title, tuple(self._flies.to(torch.int64).unique().tolist())).copy()
        _draw_numbers(panel, state)
        _draw_wind(panel, *state.wind.mean((0, 2, 3)).tolist())
        height = max(panel.height, picture.height)
        canvas = Image.new("RGB", (picture.width + panel.width + 3 * _MARGIN, height + 2 * _MARGIN), _PAPER)
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


def ground_colours(state: WorldState) -> Tensor:
    """Return the colour of each cell, uint8 [B, H, W, 3]; in fog what no agent saw in the last 16 steps."""
    cells = state.cells.to(torch.int64)
    row = state.landscape.cover.to(torch.int64) * _AGES + cells
    row = torch.where(is_burning(state.cells), cells + (_FIRE_ROW - FIRST_FIRE), row)
    row = row.masked_fill(state.burned & (cells == EMPTY), _ASH_ROW)
    row = row.masked_fill(state.firebreak & (cells == EMPTY), _FIREBREAK_ROW)
    row = row + (state.wet > 0) * _WET_ROW
    records = records_of(state)
    if records is not None:
        lately = freshness(records.amax(dim=1, keepdim=True), state.step)[:, 0] >= _LATELY
        row = torch.where(lately, row, row % _WET_ROW + _FOG_ROW)
    return _colour_table(cells.device)[row]


def _with_borders(image: Tensor, owner: Tensor) -> Tensor:
    """Return images, uint8 [B, h, w, 3], with a line two pixels wide between the lands of agencies, uint8 [B, h, w]."""
    border = torch.zeros_like(owner, dtype=torch.bool)
    for dim in (1, 2):
        differs = owner.diff(dim=dim) != 0
        border.narrow(dim, 0, owner.shape[dim] - 1).logical_or_(differs)
        border.narrow(dim, 1, owner.shape[dim] - 1).logical_or_(differs)
    return torch.where(border[..., None], torch.tensor(_INK, dtype=torch.uint8, device=image.device), image)


@kept(8)
def _colour_table(device: torch.device) -> Tensor:
    """Return the colours of dry, of wet, and of cells in fog: trees by cover and age, fire, ash, firebreak.

    uint8 [186, 3].
    """
    empty, young, old = torch.tensor([_GROUND[cover] for cover in Cover], dtype=torch.float32).unbind(1)
    ages = young[:, None] + (old - young)[:, None] * torch.linspace(0.0, 1.0, OLDEST)[:, None]
    ground = torch.cat((empty[:, None], ages), dim=1).flatten(0, 1)
    dry = torch.cat((ground, torch.tensor([*_FIRE, _ASH, _FIREBREAK])))
    wet = dry.lerp(torch.tensor(_WATER, dtype=torch.float32), 0.65)
    wet[_FIRE_ROW:_ASH_ROW] = dry[_FIRE_ROW:_ASH_ROW]
    fog = dry.lerp(torch.tensor(_PAPER, dtype=torch.float32), 0.6)
    return torch.cat((dry, wet, fog)).round().to(torch.uint8).to(device)


def _glyphs(radius: int, device: torch.device) -> Tensor:
    """Return the roles' glyphs, a square and a larger diamond: 0 clear, 1 outline, 2 body; int64 [2, side, side]."""
    away = torch.arange(-radius, radius + 1, device=device).abs()
    room = radius - torch.stack((torch.maximum(away[:, None], away) + radius // 4, away[:, None] + away))
    return (room >= 0).to(torch.int64) + (room > radius // 8)


def _stamp(image: Tensor, centre: Tensor, roles: Tensor, scale: int = 1, there: Tensor | None = None) -> Tensor:
    """Draw the agents over images, aircraft on top: a little larger than a cell, and never too small to see.

    Images are uint8 [B, h, w, 3], centres (row, column) int64 [B, A, 2] [pixels], roles int64 [A].
    """
    radius = max(6, round(0.8 * scale))
    worlds, height, width, _ = image.shape
    device, agents = image.device, roles.shape[0]
    part = _glyphs(radius, device)[roles]
    rank = (roles * agents + torch.arange(agents, device=device))[:, None, None]
    layer = (rank * 3 + part) * (part > 0)  # the largest wins, in whatever order the agents are drawn
    layer = layer[None] if there is None else layer * there[..., None, None]
    offset = torch.arange(2 * radius + 1, device=device)  # from the corner of a canvas with a margin of a radius
    row, column = centre[..., 0, None, None] + offset[:, None], centre[..., 1, None, None] + offset
    index = (row * (width + 2 * radius) + column).flatten(1)
    top = torch.zeros(worlds, height + 2 * radius, width + 2 * radius, dtype=torch.int32, device=device)
    top.flatten(1).scatter_reduce_(1, index, layer.int().expand(worlds, -1, -1, -1).flatten(1), "amax")
    top = top[:, radius:-radius, radius:-radius]
    paint = torch.tensor(_AGENT, dtype=torch.uint8, device=device)[top // (3 * agents), (top % 3 - 1).clamp(min=0)]
    return torch.where((top > 0)[..., None], paint, image)


def _fitted_map(state: WorldState, flies: Tensor) -> np.ndarray:
    """Return the map of one world with its longer side near 384 pixels, uint8 [h, w, 3]; a large one is averaged."""
    flies, (height, width) = flies.to(state.cells.device), state.cells.shape[1:]
    shrink = max(height, width) / _MAP_SIDE
    if shrink <= 1.5:
        return render(state, flies, max(1, round(1 / shrink)))[0].cpu().numpy()
    colours = ground_colours(state).movedim(3, 1).float()
    image = interpolate(colours, (math.ceil(height / shrink), math.ceil(width / shrink)), mode="area").round()
    place = (state.vehicles.position / shrink).long()
    return _stamp(image.byte().movedim(1, 3), place, flies.long(), 1, on_scene(state))[0].cpu().numpy()


@lru_cache(maxsize=1)
def _gif_palette() -> Image.Image:
    """Return the one palette of all frames: every colour of the map and the agents, and 48 shades of text."""
    shades = np.linspace(_PAPER, _INK, 48).round()
    colours = np.concatenate((_colour_table(torch.device("cpu")), np.reshape(_AGENT, (-1, 3)), shades))
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
def _legend(title: str, roles: tuple[int, ...]) -> Image.Image:
    """Return the constant part of the panel: title and legend."""
    panel = Image.new("RGB", _PANEL, _PAPER)
    for line, y, size, colour in zip(title.splitlines(), (9, 36), (22, 15), (_INK, _SOFT)):
        _write(panel, (0, y), line, size, colour)
    table = _colour_table(torch.device("cpu")).numpy()
    trees = table[:_FIRE_ROW].reshape(len(Cover), _AGES, 3)
    fire, ember, ash, firebreak = np.split(table[_FIRE_ROW:_WET_ROW], [4, 5, 6])
    left = {cover.name.capitalize(): trees[cover, 1:] for cover in list(Cover)[: Cover.BARE]}
    left |= {"No tree": trees[1:, 0], "Wet": table[_WET_ROW + _AGES : _WET_ROW + 4 * _AGES : 8]}
    right = {"Fire": fire, "Ember": ember, "Ash": ash, "Firebreak": firebreak}
    for x, entries in ((0, left), (_COLUMN, right)):
        for y, (name, colours) in zip(range(262, 400, 20), entries.items()):
            _paste_strip(panel, colours, x, y, 30, 15)
            _write(panel, (x + 38, y + 7), name, 13, _INK)
    for y, role in zip((342, 362), roles):
        ground = torch.tensor(_PAPER, dtype=torch.uint8).expand(1, 15, 31, 3)
        glyph = _stamp(ground, torch.tensor([[[7, 15]]]), torch.tensor([role]))[0].numpy()
        panel.paste(Image.fromarray(glyph), (_COLUMN, y))
        _write(panel, (_COLUMN + 38, y + 7), ("Bulldozer", "UAV")[role], 13, _INK)
    return panel


def _paste_strip(panel: Image.Image, colours: np.ndarray, x: int, y: int, width: int, height: int) -> None:
    """Paste colours, uint8 [n, 3], side by side, with a thin frame around them."""
    panel.paste(Image.fromarray(colours[None]).resize((width, height), Image.Resampling.NEAREST), (x, y))
    ImageDraw.Draw(panel).rectangle((x, y, x + width - 1, y + height - 1), outline=_LINE)


def _draw_numbers(panel: Image.Image, state: WorldState) -> None:
    """Write the clock and the share of the trees, and draw what became of the trees as a bar."""
    counts = count_trees(state)
    fates = torch.stack((counts.preserved + counts.extinguished, counts.burning, counts.cleared), dim=1)
    share = (fates[0] / counts.initial).cpu()
    clock = (("Step", f"{int(state.step)}"), ("Fire tick", f"{int(state.tick)}"))
    for place, (name, value) in enumerate((*clock, ("Saved", f"{share[0]:.1%}"), ("Burning", f"{share[1]:.1%}"))):
        x, y = _COLUMN * (place % 2), 69 + 46 * (place // 2)
        _write(panel, (x, y), name, 13, _SOFT)
        _write(panel, (x, y + 19), value, 22, _INK)
    fate = torch.bucketize((torch.arange(_PANEL[0]) + 0.5) / _PANEL[0], share.cumsum(0))
    rows = torch.tensor([Cover.FOREST * _AGES + 4, _FIRE_ROW + 2, _FIREBREAK_ROW, _ASH_ROW])
    _paste_strip(panel, _colour_table(torch.device("cpu"))[rows[fate]].numpy(), 0, 157, _PANEL[0], 12)


def _draw_wind(panel: Image.Image, u: float, v: float) -> None:
    """Draw the mean wind (u east, v north) [m/s] as an arrow in a ring that points where the air goes."""
    speed = math.hypot(u, v)
    dial = Image.new("RGB", (232, 232), _PAPER)  # four times its size, for smooth edges
    draw = ImageDraw.Draw(dial)
    draw.ellipse((2, 2, 229, 229), outline=_LINE, width=7)
    if speed >= 0.05:
        east, south = u / speed, -v / speed
        arrow = ((84, 0), (20, 34), (20, 8), (-78, 8), (-78, -8), (20, -8), (20, -34))
        draw.polygon([(116 + a * east - b * south, 116 + a * south + b * east) for a, b in arrow], _INK)
    panel.paste(dial.reduce(4), (0, 184))
    _write(panel, (_COLUMN - 30, 203), "Wind", 13, _SOFT)
    _write(panel, (_COLUMN - 30, 222), f"{speed:.1f} m/s" if speed >= 0.05 else "calm", 22, _INK)
