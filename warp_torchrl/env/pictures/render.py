"""Worlds as images."""

import torch
from torch import Tensor

from warp_torchrl.env.pictures.colours import (
    AGENT,
    AGES,
    ASH_ROW,
    FIRE_ROW,
    FIREBREAK_ROW,
    FOG_ROW,
    HOUSE,
    INK,
    LOST,
    PAPER,
    WET_ROW,
    colour_table,
)
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.records import freshness, records_of
from warp_torchrl.world.state.state import EMPTY, FIRST_FIRE, WorldState
from warp_torchrl.world.team.presence import on_scene

_LATELY = 0.5  # freshness of what was seen 16 steps ago, from which a cell is in fog


def render(state: WorldState, flies: Tensor | None, scale: int = 12, buildings: Tensor | None = None) -> Tensor:
    """Draw each world.

    Args:
        state: The worlds, batch size [B].
        flies: Which agents are aircraft, bool [A]; None leaves the agents out.
        scale: Side of a cell [pixels].
        buildings: Of ``World.buildings``; None draws none.

    Returns:
        uint8 [B, H * scale, W * scale, 3], on the state's device.

    Raises:
        ValueError: If the scale is below 1.
    """
    if scale < 1:
        raise ValueError(f"scale must be at least 1 pixel, got {scale}")
    return painted(ground_colours(state), state, flies, scale, buildings)


def painted(
    colours: Tensor, state: WorldState, flies: Tensor | None, scale: int, buildings: Tensor | None = None
) -> Tensor:
    """Return ``render`` of worlds whose cells have other colours, uint8 [B, H, W, 3]."""
    image = colours.repeat_interleave(scale, dim=1).repeat_interleave(scale, dim=2)
    image = image if buildings is None else with_buildings(image, buildings, scale)
    owner = state.plane("agencies", "owner")
    if owner is not None:
        image = _with_borders(image, owner.repeat_interleave(scale, dim=1).repeat_interleave(scale, dim=2))
    if flies is None:
        return image
    return stamp(image, state.vehicles.position * scale + scale // 2, flies.to(torch.int64), scale, on_scene(state))


def ground_colours(state: WorldState) -> Tensor:
    """Return the colour of each cell, uint8 [B, H, W, 3]; in fog what no agent saw in the last 16 steps."""
    cells = state.cells.to(torch.int64)
    row = state.landscape.cover.to(torch.int64) * AGES + cells
    row = torch.where(is_burning(state.cells), cells + (FIRE_ROW - FIRST_FIRE), row)
    row = row.masked_fill(state.burned & (cells == EMPTY), ASH_ROW)
    row = row.masked_fill(state.firebreak & (cells == EMPTY), FIREBREAK_ROW)
    row = row + (state.wet > 0) * WET_ROW
    records = records_of(state)
    if records is not None:
        lately = freshness(records.amax(dim=1, keepdim=True), state.step)[:, 0] >= _LATELY
        row = torch.where(lately, row, row % WET_ROW + FOG_ROW)
    return colour_table(cells.device)[row]


def stamp(image: Tensor, centre: Tensor, roles: Tensor, scale: int = 1, there: Tensor | None = None) -> Tensor:
    """Draw agents over images, aircraft on top: a little larger than a cell, and never too small to see.

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
    paint = torch.tensor(AGENT, dtype=torch.uint8, device=device)[top // (3 * agents), (top % 3 - 1).clamp(min=0)]
    return torch.where((top > 0)[..., None], paint, image)


def with_buildings(image: Tensor, left: Tensor, scale: int) -> Tensor:
    """Return images, uint8 [B, h, w, 3], with a square in each cell where something stands, in an outline.

    Args:
        image: The images.
        left: Of ``Mechanic.buildings``, float32 [B, H, W].
        scale: Side of a cell [pixels].
    """
    tones = torch.tensor((PAPER, HOUSE, LOST), dtype=torch.uint8, device=image.device)
    inside = torch.arange(scale, device=image.device)
    inside = (inside >= scale // 4) & (inside < scale - scale // 4)
    body = inside[:, None] & inside
    part = torch.where(left >= 0.5, 1, 2)[..., None, None] * body  # 0 is the outline
    shown = (left >= 0.0)[..., None, None].expand_as(part)
    part, shown = (each.transpose(2, 3).flatten(3, 4).flatten(1, 2) for each in (part, shown))
    return torch.where(shown[..., None], tones[part], image)


def _with_borders(image: Tensor, owner: Tensor) -> Tensor:
    """Return images, uint8 [B, h, w, 3], with a line two pixels wide between the lands of agencies, uint8 [B, h, w]."""
    border = torch.zeros_like(owner, dtype=torch.bool)
    for dim in (1, 2):
        differs = owner.diff(dim=dim) != 0
        border.narrow(dim, 0, owner.shape[dim] - 1).logical_or_(differs)
        border.narrow(dim, 1, owner.shape[dim] - 1).logical_or_(differs)
    return torch.where(border[..., None], torch.tensor(INK, dtype=torch.uint8, device=image.device), image)


def _glyphs(radius: int, device: torch.device) -> Tensor:
    """Return the roles' glyphs, a square and a larger diamond: 0 clear, 1 outline, 2 body; int64 [2, side, side]."""
    away = torch.arange(-radius, radius + 1, device=device).abs()
    room = radius - torch.stack((torch.maximum(away[:, None], away) + radius // 4, away[:, None] + away))
    return (room >= 0).to(torch.int64) + (room > radius // 8)
