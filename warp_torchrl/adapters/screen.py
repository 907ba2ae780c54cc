"""Where pictures of a world go: an array, or a window."""

from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
from gymnasium import logger

RENDER_MODES = ("human", "rgb_array")
FRAMES_PER_SECOND = 8


class Screen:
    """Shows a world as its render mode says.

    Args:
        draw: Returns the picture, uint8 [H, W, 3].
        render_mode: ``human``, a window; ``rgb_array``, an array; or None, nothing.
        title: Of the window.

    Raises:
        ValueError: If the mode is unknown.
        RuntimeError: If a window is asked for where there is no display or no matplotlib.
    """

    def __init__(self, draw: Callable[[], np.ndarray], render_mode: str | None, title: str) -> None:
        if render_mode not in (None, *RENDER_MODES):
            raise ValueError(f"render_mode must be None, {' or '.join(RENDER_MODES)}, got {render_mode!r}")
        self._draw, self._mode = draw, render_mode
        self._window = Window(title) if render_mode == "human" else None

    def refresh(self) -> None:
        """Show the world as it is now, where there is a window."""
        if self._window is not None:
            self._window.show(self._draw())

    def render(self) -> np.ndarray | None:
        """Return the picture, uint8 [H, W, 3], in mode ``rgb_array``."""
        if self._mode is None:
            logger.warn("render() shows nothing: make the environment with render_mode='rgb_array' or 'human'")
        self.refresh()
        return self._draw() if self._mode == "rgb_array" else None

    def close(self) -> None:
        """Close the window."""
        if self._window is not None:
            self._window.close()


class Window:
    """A window of matplotlib's.

    Args:
        title: Of the window.

    Raises:
        RuntimeError: If there is no display or no matplotlib.
    """

    def __init__(self, title: str) -> None:
        if find_spec("matplotlib") is None:
            raise RuntimeError("render_mode 'human' needs matplotlib, which is not installed; 'rgb_array' does not")
        from matplotlib import pyplot

        self._pyplot = pyplot
        try:
            self._figure = pyplot.figure(title, frameon=False)
        except ImportError as error:  # a viewer is asked for by name, and has no display
            raise RuntimeError(f"render_mode 'human' needs a display; 'rgb_array' does not: {error}") from None
        if self._figure.canvas.required_interactive_framework is None:
            self.close()
            raise RuntimeError(
                f"render_mode 'human' needs a display and a viewer, got matplotlib's {pyplot.get_backend()}; "
                "'rgb_array' needs none"
            )
        axes = self._figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        self._image = axes.imshow(np.zeros((1, 1, 3), np.uint8))
        self._figure.show()

    def show(self, frame: np.ndarray) -> None:
        """Show a picture, uint8 [H, W, 3]."""
        self._image.set_data(frame)
        self._image.set_extent((0.0, frame.shape[1], frame.shape[0], 0.0))
        self._figure.canvas.draw_idle()
        self._figure.canvas.flush_events()

    def close(self) -> None:
        """Close the window."""
        self._pyplot.close(self._figure)
