"""The bulldozers of one NumPy world: moves, acts, observations and rewards, all agents at once."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from warp_torchrl.benchmark.numpy_world import NumpyWorld
from warp_torchrl.env.reward import Efficiency
from warp_torchrl.world.arrays.geometry import DIRECTIONS
from warp_torchrl.world.state.state import EMBER, FIRST_FIRE, OLDEST, Action, Cover

_CODES = np.arange(EMBER + 1)
_AGE = np.where(_CODES <= OLDEST, _CODES / OLDEST, 0.0).astype(np.float32)
_STAGE = np.where(_CODES >= FIRST_FIRE, (_CODES - OLDEST) / 5.0, 0.0).astype(np.float32)
_COVER = (np.arange(6) / 5.0).astype(np.float32)
_NOTHING = 255


class NumpyTeam:
    """Bulldozers with the rules of ``Team``, the observation ``paper`` and the reward ``efficiency``.

    Args:
        world: Where they are; their acts change it.
        cover: Land cover, uint8 [H, W].
        position: int64 [A, 2], (row, column) [cells].
        radius: r of the view [cells].
        reward: Weights.
    """

    def __init__(
        self, world: NumpyWorld, cover: np.ndarray, position: np.ndarray, radius: int, reward: Efficiency
    ) -> None:
        self.world, self.radius, self.reward = world, radius, reward
        self.position = (position[:, 0] + 1) * world.stride + position[:, 1] + 1  # into the world's arrays
        offsets = [row * world.stride + column for row, column in DIRECTIONS]
        self._move = np.array([*offsets, 0, 0, 0])
        # Ties go to the own cell, then in row-major order.
        self._around = np.array([0, *sorted(offsets)])
        can_be_put_out = (_CODES >= FIRST_FIRE) & (world.fire.last_spreading >= _CODES)
        self._rank = np.where(can_be_put_out, _CODES, _NOTHING)
        self._dry = np.pad(cover != Cover.LAKE, 1).ravel()
        side, margin = 2 * radius + 1, ((radius, radius), (radius, radius))
        self._seen_cover = sliding_window_view(np.pad(cover + 1, margin), (side, side))
        self._frame = np.zeros(np.add(cover.shape, 2 * radius), dtype=np.uint8)
        self._seen_cells = sliding_window_view(self._frame, (side, side))
        self._value, self._potential = self._worth(), self._distance()

    @property
    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """Return row and column of each agent, int64 [A] each [cells]."""
        row, column = np.divmod(self.position, self.world.stride)
        return row - 1, column - 1

    def act(self, action: np.ndarray) -> int:
        """Let the agents move, put fire out and clear trees.

        Args:
            action: int64 [A], ``Action`` codes.

        Returns:
            How many chose to extinguish or to clear.
        """
        world = self.world
        cells = world.cells
        target = self.position + self._move[action]
        self.position = np.where(self._dry[target] & (cells[target] < FIRST_FIRE), target, self.position)
        wants_water, wants_clear = action == Action.EXTINGUISH, action == Action.CLEAR
        own = cells[self.position]
        cut = self.position[wants_clear & (own > 0) & (own <= OLDEST)]
        if wants_water.any():
            around = self.position[wants_water, None] + self._around
            rank = self._rank[cells[around]]
            best = rank.argmin(axis=1)[:, None]
            # Two agents at one fire write the same twice.
            hit = np.take_along_axis(around, best, 1)[np.take_along_axis(rank, best, 1) < _NOTHING]
            cells[hit], world.extinguished[hit], world.wet[hit] = world.age[hit], True, world.fire.wet_for
            world.age[hit] = 0
        cells[cut], world.firebreak[cut] = 0, True
        return int(np.count_nonzero(wants_water | wants_clear))

    def observe(self) -> np.ndarray:
        """Return the agents' observations, float32 [A, 3 (2 r + 1)^2]: see ``warp_torchrl.env.observation.Paper``."""
        radius = self.radius
        self._frame[radius:-radius, radius:-radius] = self.world.on_map(self.world.cells)
        row, column = self.places
        cells = self._seen_cells[row, column]
        seen = np.stack((_COVER[self._seen_cover[row, column]], _AGE[cells], _STAGE[cells]), axis=1)
        return seen.reshape(len(row), -1)

    def earn(self, acts: int, terminated: bool) -> float:
        """Return each agent's reward for the step that ends now, the team's mean; see ``Efficiency``.

        Args:
            acts: How many agents chose to extinguish or to clear.
            terminated: Whether nothing burns any more.
        """
        rule = self.reward
        value, potential = self._worth(), 0.0 if terminated else self._distance()
        cost = rule.act / self.world.n_initial if rule.act_per == "tree" else rule.act
        gained = value - self._value - cost * acts + rule.shaping * (rule.gamma * potential - self._potential)
        self._value, self._potential = value, potential
        return float(rule.scale * gained)

    def _worth(self) -> float:
        """Return Q."""
        preserved, extinguished, cleared, burned = self.world.counts()
        rule = self.reward
        gain = rule.preserved * preserved + rule.extinguished * extinguished
        return (gain - rule.cleared * cleared - rule.burned * burned) / self.world.n_initial

    def _distance(self) -> float:
        """Return the team's mean potential, -0.5 x the distance to the nearest fire / H."""
        fires = np.flatnonzero(self.world.cells >= FIRST_FIRE)
        if not len(fires):
            return 0.0
        down, across = (
            np.abs(here[:, None] - there)
            for here, there in zip(np.divmod(self.position, self.world.stride), np.divmod(fires, self.world.stride))
        )
        return -0.5 / self.world.size[0] * float(np.maximum(down, across).min(axis=1).mean())
