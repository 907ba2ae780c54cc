"""Growth of a fire's front by sector, as perimeters and hot spots of satellites show it.

Around the middle of what had burned lie sectors of equal angle. What is compared in each one is y = ln(n + a) of the n
cells, or pixels, that were seen to burn, with a half of the f cells along the front: half a cell is what a front is
known to. So a member is as wrong with half of the growth as with twice the growth, and a front that stays says little
but that. The variance of y is q^2 / (n + a)^2, q^2 = f / 4 + 1 / 4.
"""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import max_pool2d, pad

from warp_torchrl.validation import check_fields
from warp_torchrl.world.fires.sectors import by_sector, sectors_about


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


@dataclass(frozen=True, eq=False)
class Sight:
    """Growth of a front in S sectors: what was seen, and how members are compared with it.

    Attributes:
        seen: y, float32 [S].
        none: What y is where nothing grew, float32 [S].
        variance: Of y, by what is not seen, float32 [S].
        sector: The sector of each cell, int64 [H, W].
        of: Function from arrivals of members, float32 [K, H, W] [minutes since the observation before], to their y,
            float32 [K, S].
    """

    seen: Tensor
    none: Tensor
    variance: Tensor
    sector: Tensor
    of: Callable[[Tensor], Tensor]


def perimeter_sight(front: Front) -> Sight:
    """Return the growth that a perimeter shows."""
    where, asked = sectors_about(front.known), front.fuel & ~front.known
    seen, along = (by_sector(each[None], where)[0] for each in (front.growth & front.fuel, beside(front.known) & asked))
    half = along.clamp(min=1.0) / 2.0

    def said(arrival: Tensor) -> Tensor:
        return torch.log(by_sector((arrival <= front.minutes) & asked, where) + half)

    variance = (along + 1.0) / 4.0 / (seen + half).square()
    return Sight(torch.log(seen + half), torch.log(half), variance, where, said)


def hot_spot_sight(front: Front, hot: Tensor, sensor: HotSpotSensor, cell_size: float) -> Sight:
    """Return the growth that hot spots show, by the pixels in which nothing was known to have burned before.

    A member expects that they are marked by ``detection`` where it burns there or did lately, else by ``false_alarm``.
    Chance adds n (1 - detection) to q^2.

    Args:
        front: What had burned, as hot spots show it.
        hot: Cells in which a hot spot lies, bool [H, W].
        sensor: The satellite.
        cell_size: Side of a cell [m].
    """
    side = sensor.side(cell_size)
    known = pixels(front.known[None], side)
    asked, where = pixels(front.fuel[None], side) & ~known, sectors_about(known[0])
    planes = pixels(hot[None], side), beside(known[0]), torch.ones_like(known)
    seen, along, all_of = (by_sector(each & asked, where)[0] for each in planes)
    half = along.clamp(min=1.0) / 2.0

    def said(arrival: Tensor) -> Tensor:
        burns = (arrival <= front.minutes) & (arrival > front.minutes - 60.0 * sensor.lately) & front.fuel
        chance = torch.where(pixels(burns, side), sensor.detection, sensor.false_alarm) * asked
        return torch.log(by_sector(chance, where) + half)

    variance = ((along + 1.0) / 4.0 + seen * (1.0 - sensor.detection)) / (seen + half).square()
    none = torch.log(all_of * sensor.false_alarm + half)
    return Sight(torch.log(seen + half), none, variance, sectors_about(front.known), said)


def beside(cells: Tensor) -> Tensor:
    """Return the cells that share a side with some cells, bool [H, W]."""
    wide = pad(cells, (1, 1, 1, 1))
    return (wide[2:, 1:-1] | wide[:-2, 1:-1] | wide[1:-1, 2:] | wide[1:-1, :-2]) & ~cells


def pixels(cells: Tensor, side: int) -> Tensor:
    """Return which pixels of ``side`` x ``side`` cells have some of the cells, bool [K, h, w]."""
    height, width = cells.shape[1:]
    whole = pad(cells.to(torch.float32), (0, -width % side, 0, -height % side))
    return max_pool2d(whole[:, None], side, side)[:, 0] > 0.0
