"""Observation of one vehicle's agent, as pictures and numbers."""

import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFont
from torch import Tensor

from warp_torchrl.live.side import Side
from warp_torchrl.models import OBSERVATION

_ACROSS = 4  # channels beside each other
_PAPER, _INK, _MARK = (24, 27, 32), (226, 228, 232), (255, 214, 64)
_HEADING = 13  # height of a channel's name [pixels]


def entries(side: Side, agent: int) -> dict[str, Tensor]:
    """Return the entries of an agent's observation by name, maps [C, V, V] and vectors [F]."""
    seen = side.shown[OBSERVATION]
    named = dict(seen.items()) if hasattr(seen, "items") else {"": seen}
    return {str(name): value[0, agent] for name, value in named.items()}


def pictures(side: Side, agent: int, tile: int = 84) -> dict[str, np.ndarray]:
    """Return each map that an agent sees as one picture of its channels, uint8 [h, w, 3], by the entry's name.

    A channel is black where it shows its least and bright where it shows its largest number; the middle, where the
    agent is, is framed.

    Args:
        side: Whose team it is of.
        agent: Its index.
        tile: Side of a channel [pixels].
    """
    spaces = side.env.observation.spaces(side.env.world)
    maps = {name: value for name, value in entries(side, agent).items() if value.ndim == 3}
    return {
        name: _sheet(value.float() / _highs(spaces[name].high, len(value)), spaces[name].names, tile)
        for name, value in maps.items()
    }


def named_numbers(side: Side, agent: int) -> dict[str, float]:
    """Return the numbers of an agent's observation by name, such as those of ``status``."""
    found: dict[str, float] = {}
    for name, value in entries(side, agent).items():
        names = side.env.channel_names.get(name, ())
        if value.ndim == 1 and len(names) == len(value):
            found |= dict(zip(names, value.tolist()))
    return found


def _highs(high: float | tuple[float, ...], channels: int) -> Tensor:
    return torch.tensor(high, dtype=torch.float32).expand(channels)[:, None, None]


def _sheet(shares: Tensor, names: tuple[str, ...], tile: int) -> np.ndarray:
    """Return channels [C, V, V] in 0..1 side by side with their names."""
    count, side = shares.shape[0], shares.shape[1]
    across, step = min(_ACROSS, count), tile + 4
    image = Image.new("RGB", (across * step, -(-count // across) * (step + _HEADING)), _PAPER)
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(10)
    light = _heat(shares.clamp(0.0, 1.0))
    cell = tile / side
    for channel in range(count):
        x, y = (channel % across) * step, (channel // across) * (step + _HEADING) + _HEADING
        shown = Image.fromarray(light[channel]).resize((tile, tile), Image.Resampling.NEAREST)
        image.paste(shown, (x, y))
        draw.text((x, y - 2), names[channel] if names else f"{channel}", _INK, font, anchor="ls")
        low = (side // 2) * cell
        if side % 2:
            draw.rectangle((x + low - 1, y + low - 1, x + low + cell, y + low + cell), outline=_MARK)
    return np.asarray(image)


def _heat(shares: Tensor) -> np.ndarray:
    """Return shares in 0..1 as colours from dark blue over orange to near white, uint8 [..., 3]."""
    stops = torch.tensor([(18, 20, 34), (92, 44, 110), (212, 84, 60), (250, 186, 74), (255, 252, 226)]).float()
    place = shares * (len(stops) - 1)
    low = place.long().clamp(max=len(stops) - 2)
    return stops[low].lerp(stops[low + 1], (place - low)[..., None]).round().byte().numpy()
