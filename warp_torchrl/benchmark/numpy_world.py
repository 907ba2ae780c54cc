"""One world in NumPy with the same law, for comparisons of speed.

It is reasonably optimised: float32, whole-array operations, buffers and probabilities computed once per episode.
The map lies in one row with a border of empty cells, so that neighbours are contiguous slices.
"""

import math

import numpy as np

from warp_torchrl.world.air.wind import Wind
from warp_torchrl.world.arrays.geometry import DIRECTIONS, DISTANCES
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.state import EMBER, FIRST_FIRE, OLDEST, Cover

_ONE = np.float32(1.0)


def plays(fire: Fire, wind: Wind) -> bool:
    """Return whether the NumPy world has this fire's law and this wind."""
    return type(fire) is Fire and fire.kernel == "alexandridis" and not wind.changes


class NumpyWorld:
    """The fire of one world, law ``paper``.

    Attributes, all of length n = (H + 2) (W + 2): ``cells``, ``age`` and ``wet``, uint8; ``burned``, ``extinguished``,
    ``firebreak`` and ``initial``, bool; as in ``WorldState``. ``on_map`` shows one as a map.

    Args:
        fire: The rules.
        cover: uint8 [H, W].
        cells: uint8 [H, W]; every tree and fire counts as an initial tree.
        wind: (u east, v north), float32 [2, 1, 1] or [2, H, W] [m/s].
        elevation: float32 [H, W] [m]; None is flat.
        cell_size: Side of a cell [m].
    """

    def __init__(
        self,
        fire: Fire,
        cover: np.ndarray,
        cells: np.ndarray,
        wind: np.ndarray,
        elevation: np.ndarray | None = None,
        cell_size: float = 30.0,
    ) -> None:
        self.fire = fire
        self.size = cover.shape
        self.stride = cover.shape[1] + 2
        alpha = np.array(fire.alpha, dtype=np.float32)[cover]
        self.cells, self.age = np.pad(cells, 1).ravel(), np.zeros((cover.shape[0] + 2) * self.stride, np.uint8)
        self.land = np.pad((cover != Cover.LAKE) & (cover != Cover.BARE), 1).ravel()
        self.wet = np.zeros_like(self.cells)
        self.initial = self.cells > 0
        self.burned, self.extinguished, self.firebreak = np.zeros((3, self.cells.size), dtype=bool)
        self._can_burn = np.pad(alpha > 0.0, 1).ravel()
        directions = range(0, 8, 8 // fire.neighbours)
        chances = _chances(fire, alpha, wind, elevation, cell_size)
        self._minus_chance = [np.pad(-chances[each], 1).ravel() for each in directions]
        self._make_buffers([row * self.stride + column for row, column in (DIRECTIONS[each] for each in directions)])
        ages = np.arange(EMBER + 1)
        is_age = (ages >= 1) & (ages <= fire.oldest)
        grows = np.where(is_age & (ages < fire.oldest), np.exp(-ages / fire.oldest * fire.tau), 0.0)
        self._grows = grows.astype(np.float32)
        lightning = np.minimum(1.0, fire.beta * np.exp(10.0 * (ages / fire.oldest - 1.0)) / cover.size)
        self._spontaneous = np.where(is_age, lightning, 0.0).astype(np.float32)

    @property
    def n_initial(self) -> int:
        """Return N0."""
        return int(np.count_nonzero(self.initial))

    def on_map(self, row: np.ndarray) -> np.ndarray:
        """Return one of the arrays as a view [H, W]."""
        return row.reshape(-1, self.stride)[1:-1, 1:-1]

    def ignite(self, lit: np.ndarray) -> None:
        """Light trees, bool [H, W]."""
        lit = np.pad(lit, 1).ravel()
        self.age[lit] = self.cells[lit]
        self.cells[lit] = FIRST_FIRE

    def chance_to_ignite(self) -> np.ndarray:
        """Return each tree's chance to ignite in the next tick, float32 [n]; see ``Fire.chance_to_ignite``."""
        cells, fire, escape, spare = self.cells, self.fire, self._escape, self._spare
        np.logical_and(cells >= FIRST_FIRE, cells <= fire.last_spreading, out=self._spreading)
        escape.fill(1.0)
        for minus_chance, source in zip(self._minus_chance, self._sources):
            np.multiply(minus_chance, source, out=spare)
            np.add(spare, _ONE, out=spare)
            np.multiply(escape, spare, out=escape)
        fuel = (cells >= fire.youngest_fuel) & (cells <= OLDEST) & (self.wet == 0)
        np.subtract(_ONE, escape, out=escape)
        if fire.beta > 0.0:
            fuel &= self._can_burn
            spontaneous = self._spontaneous[cells]
            escape += spontaneous * (_ONE - escape)
        return escape * fuel

    def tick(self, u: np.ndarray) -> None:
        """Advance the fire by one tick; see ``Fire.tick``.

        Args:
            u: Uniform draws in [0, 1), float32 [n].
        """
        cells, fire = self.cells, self.fire
        q = self.chance_to_ignite()
        ignite, to_ash = u < q, cells == EMBER
        after = cells + (cells >= FIRST_FIRE)
        if fire.growth:
            after += u >= _ONE - (_ONE - q) * self._grows[cells]
        if fire.p_regrow > 0.0:
            after += (cells == 0) & self.land & ~self.firebreak & (u < fire.p_regrow)
        np.copyto(self.age, cells, where=ignite)
        np.copyto(after, FIRST_FIRE, where=ignite)
        after[to_ash] = 0
        self.age[to_ash] = 0
        self.burned |= to_ash
        self.wet -= self.wet > 0
        self.cells = after

    def counts(self) -> tuple[int, int, int, int]:
        """Return T_p, T_e, T_c and T_b: the initial trees untouched, put out, cleared and burned."""
        unburned = self.initial & ~self.burned
        alive = unburned & (self.cells > 0) & (self.cells <= OLDEST)
        extinguished = int(np.count_nonzero(alive & self.extinguished))
        cleared = int(np.count_nonzero(unburned & self.firebreak))
        burned = self.n_initial - int(np.count_nonzero(unburned))
        return int(np.count_nonzero(alive)) - extinguished, extinguished, cleared, burned

    @property
    def is_alight(self) -> bool:
        """Return whether any cell burns."""
        return bool(self.cells.max() >= FIRST_FIRE)

    def _make_buffers(self, shifts: list[int]) -> None:
        """Make what a tick writes into, and views of the burning cells that are shifted by each direction."""
        n, margin = self.cells.size, self.stride + 1
        burning = np.zeros(n + 2 * margin, dtype=np.float32)
        self._spreading = burning[margin : margin + n]
        self._sources = [burning[margin - shift : margin - shift + n] for shift in shifts]
        self._escape, self._spare = np.empty((2, n), dtype=np.float32)


def _chances(
    fire: Fire, alpha: np.ndarray, wind: np.ndarray, elevation: np.ndarray | None, cell_size: float
) -> np.ndarray:
    """Return the chance to be ignited from each direction by a neighbour that burns, float32 [8, H, W].

    p_d = clip(alpha w_d s_d / dist_d, 0, 1), wind read at the source; see ``warp_torchrl.world.law.law``.
    """
    height, width = alpha.shape
    u, v = wind if wind.shape[1:] == (1, 1) else np.pad(wind, ((0, 0), (1, 1), (1, 1)))
    ground = None if elevation is None else np.pad(elevation, 1, mode="edge")
    chances = np.empty((8, height, width), dtype=np.float32)
    for (row, column), distance, chance in zip(DIRECTIONS, DISTANCES, chances, strict=True):
        source = slice(1 - row, 1 - row + height), slice(1 - column, 1 - column + width)
        speed, along = np.hypot(u, v), (u * column - v * row) / distance
        factor = np.exp((fire.wind_gain - fire.wind_focus) * speed + fire.wind_focus * along)
        factor = factor if factor.size == 1 else factor[source]
        if ground is not None:
            slope = np.arctan((elevation - ground[source]) / (distance * cell_size)) * (180.0 / math.pi)
            factor = factor * np.exp(fire.slope_gain * slope)
        np.minimum(alpha * factor / (1.0 if fire.diagonal == "unit" else distance), 1.0, out=chance)
    return chances
