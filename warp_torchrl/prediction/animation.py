"""One fire as a GIF: what burns, minute by minute, over paled ground."""

import io
from pathlib import Path

import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFont
from torch import Tensor

from warp_torchrl.env.pictures.drawing import cover_image, hillshade
from warp_torchrl.system import disk
from warp_torchrl.world.state.state import Landscape

_SIDE = 480  # of the map's longer side [pixels]
_STRIP = 24  # below it, for the clock [pixels]
_FRAMES = 96
_FRAME_MS, _LAST_FRAME_MS = 80, 2000
_FLAME, _ASH = (226, 74, 20), (62, 54, 52)


def write_animation(
    path: Path, arrival: Tensor, ground: Landscape, cell_size: float, minutes: float, residence: float
) -> None:
    """Write the fire as frames at even times, the last one at its end.

    Args:
        path: The file.
        arrival: When the fire came, float32 [H, W] [minutes]; NaN where it did not.
        ground: The map, batch size [1].
        cell_size: Side of a cell [m].
        minutes: The fire's end.
        residence: Minutes that a cell is shown to burn, or a frame's time where that is longer.

    Raises:
        OSError: If the write fails, with the path.
    """
    light = None if ground.elevation is None else hillshade(ground.elevation[0].cpu(), cell_size)
    paled = (0.6 * cover_image(ground.cover[0].cpu(), light) + 0.4).clamp(max=1.0) * 255.0
    step = minutes / _FRAMES
    pictures = [_frame(paled, arrival, step * number, max(step, residence)) for number in range(_FRAMES + 1)]
    palette = _palette(pictures[0])
    frames = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    drawn, durations = io.BytesIO(), [_FRAME_MS] * _FRAMES + [_LAST_FRAME_MS]
    frames[0].save(drawn, "GIF", save_all=True, append_images=frames[1:], loop=0, duration=durations)
    disk.replace(path, drawn.getvalue())


def _palette(first: Image.Image) -> Image.Image:
    """Return the one palette of all frames: the ground's colours, and those of what burns and has burned."""
    whole = Image.new("RGB", (first.width, first.height + 2 * _STRIP))
    whole.paste(first, (0, 0))
    for place, colour in enumerate((_FLAME, _ASH)):
        top = first.height + place * _STRIP
        whole.paste(colour, (0, top, first.width, top + _STRIP))
    return whole.quantize(96, dither=Image.Dither.NONE)


def _frame(ground: Tensor, arrival: Tensor, minute: float, burns_for: float) -> Image.Image:
    came = arrival <= minute
    burning = came & (arrival > minute - burns_for)
    picture = torch.where(came[..., None], torch.tensor(_ASH, dtype=torch.float32), ground)
    picture = torch.where(burning[..., None], torch.tensor(_FLAME, dtype=torch.float32), picture)
    image = Image.fromarray(picture.numpy().round().astype(np.uint8))
    share = _SIDE / max(image.size)
    size = round(image.width * share), round(image.height * share)
    canvas = Image.new("RGB", (size[0], size[1] + _STRIP), "white")
    canvas.paste(image.resize(size, Image.Resampling.NEAREST if share >= 1.0 else Image.Resampling.BOX))
    hours, minutes = divmod(round(minute), 60)
    text = f"{hours:02d} h {minutes:02d} min"
    ImageDraw.Draw(canvas).text((6, size[1] + _STRIP // 2), text, "black", ImageFont.load_default(14), anchor="lm")
    return canvas
