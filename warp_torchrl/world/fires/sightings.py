"""Likelihood of what was seen of a fire: perimeters, and hot spots of satellites.

Around the middle of what had burned lie sectors of equal angle. In each one a member's growth is compared with what was
seen. Its rates are wrong from place to place by a share of deviation s, apart from what they all are wrong by, and a
front is known to half a cell:

    ln((n_k + a) / (n + a)) is normal,    variance s^2 + q^2 / (n + a)^2

of n cells seen to burn and n_k cells by member k; a is half of the f cells along the front, q^2 = f / 4 + 1 / 4. So a
member is as wrong with half of the growth as with twice the growth, and a front that stays says little but that.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import max_pool2d, pad

from warp_torchrl.validation import check_fields

LOCAL_DEVIATION = 0.3
"""s: what is left of the error of a rate where the error of the whole fire is known."""
SECTORS = 16
_SURPRISE = 0.02  # likelihood, of the highest, of growth that no member can say: fought edges, wrong fuels


@dataclass(frozen=True, kw_only=True)
class HotSpotSensor:
    """A satellite that marks pixels in which fire burns or burned lately.

    Attributes:
        pixel: Side of a pixel [m]: 375 of VIIRS, 1000 of MODIS.
        detection: Probability that a pixel with fire is marked.
        false_alarm: Probability that a pixel without fire is marked.
        lately: For how long ground is hot that has burned [h].

    Raises:
        ValueError: If a value is out of its range.
    """

    pixel: float = 375.0
    detection: float = 0.7
    false_alarm: float = 0.005
    lately: float = 6.0

    def __post_init__(self) -> None:
        check_fields(self, pixel=(1.0, 1e5), detection=(0.01, 1.0), false_alarm=(0.0, 0.5), lately=(0.0, 1e4))
        if self.false_alarm >= self.detection:
            raise ValueError(f"false_alarm must be under detection, {self.detection:g}, got {self.false_alarm:g}")

    def side(self, cell_size: float) -> int:
        """Return the cells of a pixel's side, 1 at least."""
        return max(1, round(self.pixel / cell_size))


@dataclass(frozen=True, eq=False)
class Front:
    """Advance of a fire between two observations.

    Attributes:
        known: Cells that had burned by the first one, bool [H, W].
        burned: Cells that have burned by the second one, bool [H, W].
        fuel: Cells that can burn, bool [H, W].
        minutes: Time between them.
    """

    known: Tensor
    burned: Tensor
    fuel: Tensor
    minutes: float

    @property
    def growth(self) -> Tensor:
        """Return the cells that burned in between, bool [H, W]."""
        return self.burned & ~self.known


def perimeter_likelihood(arrival: Tensor, front: Front) -> Tensor:
    """Return the logarithm of the likelihood of a perimeter under each member, float32 [K].

    Args:
        arrival: Minutes since the observation before, float32 [K, H, W].
        front: What was seen.
    """
    asked, edge = front.fuel & ~front.known, beside(front.known) & front.fuel
    came = ((arrival <= front.minutes) & asked).to(torch.float32)
    where = _sectors(front.known)
    seen, along = (_by_sector(each.to(torch.float32)[None], where) for each in (front.growth & front.fuel, edge))
    return _agreement(_by_sector(came, where), seen, along, (along + 1.0) / 4.0)


def hot_spot_likelihood(arrival: Tensor, hot: Tensor, front: Front, sensor: HotSpotSensor, cell_size: float) -> Tensor:
    """Return the logarithm of the likelihood of hot spots under each member, float32 [K].

    What is compared are pixels in which nothing was known to have burned before; a member expects that they are marked
    by ``detection`` where it burns there or did lately, else by ``false_alarm``. Chance adds n (1 - detection) to q^2.

    Args:
        arrival: Minutes since the observation before, float32 [K, H, W].
        hot: Cells in which a hot spot lies, bool [H, W].
        front: What had burned, as hot spots show it.
        sensor: The satellite.
        cell_size: Side of a cell [m].
    """
    side = sensor.side(cell_size)
    known = pixels(front.known[None], side)
    asked = pixels(front.fuel[None], side) & ~known
    burns = (arrival <= front.minutes) & (arrival > front.minutes - 60.0 * sensor.lately) & front.fuel
    chance = torch.where(pixels(burns, side), sensor.detection, sensor.false_alarm) * asked
    where = _sectors(known[0])
    seen = _by_sector((pixels(hot[None], side) & asked).to(torch.float32), where)
    along = _by_sector((beside(known[0]) & asked).to(torch.float32), where)
    return _agreement(_by_sector(chance, where), seen, along, (along + 1.0) / 4.0 + seen * (1.0 - sensor.detection))


def _agreement(said: Tensor, seen: Tensor, along: Tensor, unsure: Tensor) -> Tensor:
    """Return the logarithm of the likelihood of growth by sector, float32 [K].

    Args:
        said: n_k, float32 [K, S].
        seen: n, float32 [1, S].
        along: f, float32 [1, S].
        unsure: q^2, float32 [1, S].
    """
    half = along.clamp(min=1.0) / 2.0
    variance = LOCAL_DEVIATION**2 + unsure / (seen + half).square()
    off = torch.log((said + half) / (seen + half))
    return torch.log(_SURPRISE + (1.0 - _SURPRISE) * torch.exp(-0.5 * off.square() / variance)).sum(1)


def beside(cells: Tensor) -> Tensor:
    """Return the cells that share a side with some cells, bool [H, W]."""
    wide = pad(cells, (1, 1, 1, 1))
    return (wide[2:, 1:-1] | wide[:-2, 1:-1] | wide[1:-1, 2:] | wide[1:-1, :-2]) & ~cells


def pixels(cells: Tensor, side: int) -> Tensor:
    """Return which pixels of ``side`` x ``side`` cells have some of the cells, bool [K, h, w]."""
    height, width = cells.shape[1:]
    whole = pad(cells.to(torch.float32), (0, -width % side, 0, -height % side))
    return max_pool2d(whole[:, None], side, side)[:, 0] > 0.0


def _sectors(known: Tensor) -> Tensor:
    """Return the sector of each cell about the middle of some cells, int64 [H, W]; they may be none."""
    height, width = known.shape
    places = known.nonzero().to(torch.float32)
    row, column = places.mean(0) if len(places) else torch.tensor([height / 2.0, width / 2.0])
    south = torch.arange(height, device=known.device)[:, None] - row
    east = torch.arange(width, device=known.device) - column
    turn = torch.atan2(south, east) / (2.0 * math.pi) + 0.5
    return (turn * SECTORS).to(torch.int64).clamp(0, SECTORS - 1)


def _by_sector(values: Tensor, where: Tensor) -> Tensor:
    """Return the sums of planes in each sector, float32 [K, S]."""
    sums = torch.zeros(len(values), SECTORS, device=values.device)
    return sums.index_add_(1, where.flatten(), values.flatten(1))
