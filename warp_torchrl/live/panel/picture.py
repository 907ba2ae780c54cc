"""Pictures on a panel that are encoded once for all panels."""

import io
from typing import Any

import numpy as np
import viser
from PIL import Image

from warp_torchrl.live.stage import change


def png(picture: np.ndarray) -> bytes:
    """Return a picture, uint8 [h, w, 3], as a PNG file, which is written fast rather than small."""
    file = io.BytesIO()
    Image.fromarray(picture).save(file, format="png", compress_level=1)
    return file.getvalue()


def add_picture(gui: viser.GuiApi, label: str) -> Any:
    """Add a place for pictures, which has none yet, and return its handle."""
    return gui.add_image(np.zeros((1, 1, 3), np.uint8), label=label, format="png")


def show_picture(handle: Any, file: bytes) -> None:
    """Show a PNG file; setting viser's ``image`` would encode it for each browser."""
    change(handle, _data=file)
