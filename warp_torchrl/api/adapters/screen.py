"""Render modes: an array, a window, or text in the terminal."""

import shutil
import sys
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import Any, Protocol

import numpy as np
from gymnasium import logger

FRAMES_PER_SECOND = 8


class Viewer(Protocol):
    """Displays frames."""

    def show(self, frame: np.ndarray) -> None:
        """Display a frame, uint8 [H, W, 3]."""

    def close(self) -> None:
        """Close the display."""


class Screen:
    """Renders a world in a render mode.

    Args:
        draw: Returns the frame, uint8 [H, W, 3].
        render_mode: ``human``, a window, or the terminal without a display or pygame; ``rgb_array``, an array; or None.
        modes: Supported modes.
        title: Title of the window.

    Raises:
        ValueError: If the mode is not supported.
    """

    def __init__(
        self, draw: Callable[[], np.ndarray], render_mode: str | None, modes: Sequence[str], title: str
    ) -> None:
        if render_mode not in (None, *modes):
            raise ValueError(f"render_mode must be {' or '.join(['None', *modes])}, got {render_mode!r}")
        self._draw, self._mode = draw, render_mode
        self._viewer = viewer(title) if render_mode == "human" else None

    def refresh(self) -> None:
        """Display the current world in mode ``human``."""
        if self._viewer is not None:
            self._viewer.show(self._draw())

    def render(self) -> np.ndarray | None:
        """Return the frame, uint8 [H, W, 3], in mode ``rgb_array``; display it in mode ``human``."""
        if self._mode is None:
            logger.warn("render() shows nothing: make the environment with a render_mode")
        self.refresh()
        return self._draw() if self._mode == "rgb_array" else None

    def close(self) -> None:
        """Close the window."""
        if self._viewer is not None:
            self._viewer.close()


def viewer(title: str) -> Viewer:
    """Return a pygame window, or the terminal without a display or pygame."""
    if find_spec("pygame") is None:
        return Terminal()
    import pygame

    try:
        pygame.display.init()
    except pygame.error:
        return Terminal()
    # Without a display pygame may draw off-screen.
    return Terminal() if pygame.display.get_driver() == "offscreen" else PygameWindow(pygame, title)


class PygameWindow:
    """A pygame window.

    Args:
        pygame: The module, with its display initialised.
        title: Title of the window.
    """

    def __init__(self, pygame: Any, title: str) -> None:
        self._pygame, self._clock = pygame, pygame.time.Clock()
        pygame.display.set_caption(title)

    def show(self, frame: np.ndarray) -> None:
        """Display a frame, uint8 [H, W, 3], for its duration."""
        pygame, size = self._pygame, frame.shape[1::-1]
        surface = pygame.display.get_surface()
        if surface is None or surface.get_size() != size:
            surface = pygame.display.set_mode(size)
        surface.blit(pygame.surfarray.make_surface(frame.swapaxes(0, 1)), (0, 0))
        pygame.event.pump()
        pygame.display.flip()
        self._clock.tick(FRAMES_PER_SECOND)

    def close(self) -> None:
        """Close the window."""
        self._pygame.display.quit()


class Terminal:
    """Displays frames as text on standard output; on a terminal each frame replaces the last."""

    def show(self, frame: np.ndarray) -> None:
        """Display a frame, uint8 [H, W, 3], as large as fits the terminal."""
        columns, lines = shutil.get_terminal_size()
        start = "\x1b[H\x1b[2J" if sys.stdout.isatty() else ""
        print(start + as_text(frame, columns, lines - 1), flush=True)

    def close(self) -> None:
        """Do nothing: the last frame stays."""


def as_text(frame: np.ndarray, columns: int, lines: int) -> str:
    """Return a frame as coloured half blocks, two squares of the frame in one character.

    Args:
        frame: uint8 [H, W, 3].
        columns: Largest number of columns.
        lines: Largest number of lines.
    """
    height, width = frame.shape[:2]
    side = max(-(-width // columns), -(-height // (2 * lines)))
    down, across = height // (2 * side), width // side
    squares = frame[: down * 2 * side, : across * side].reshape(down, 2, side, across, side, 3)
    pairs = squares.mean((2, 4)).astype(np.uint8).swapaxes(1, 2).reshape(down, across, 6)
    block = "\x1b[38;2;{};{};{}m\x1b[48;2;{};{};{}m▀"
    return "\n".join("".join(block.format(*pair) for pair in row) + "\x1b[0m" for row in pairs)
