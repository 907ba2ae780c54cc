"""Parameters in which imagined fires differ from the law and the weather, and how far."""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.random import Stream, log_deviation, normal

PARAMETERS = ("rate", "wind_speed", "bearing", "moisture")
"""Logarithms of the factors on all rates and on the wind's speed, the turn of the wind's bearing [degrees clockwise],
and the logarithm of the factor on the moisture of dead fuel."""


@dataclass(frozen=True, kw_only=True)
class Deviations:
    """How far members differ before anything is seen.

    Attributes:
        rate: Coefficient of variation of the factor on all rates. Of 49 data sets a good model's error was 0.35 (Cruz
            and Alexander 2013).
        wind_speed: Coefficient of variation of the factor on the wind's speed.
        bearing: Standard deviation of the turn of the wind's bearing [degrees].
        moisture: Coefficient of variation of the factor on the moisture of dead fuel.
        local: Coefficient of variation of the rate from sector to sector of the front.
        held: Share of the front that does not advance, for it is fought or has no fuel that the map does not show.

    Raises:
        ValueError: If a value is out of its range.
    """

    rate: float = 0.4
    wind_speed: float = 0.25
    bearing: float = 20.0
    moisture: float = 0.15
    local: float = 0.3
    held: float = 0.05

    def __post_init__(self) -> None:
        check_fields(
            self,
            rate=(0.0, 2.0),
            wind_speed=(0.0, 2.0),
            bearing=(0.0, 180.0),
            moisture=(0.0, 1.0),
            local=(0.0, 1.0),
            held=(0.0, 0.4),
        )

    @property
    def scales(self) -> Tensor:
        """Return the standard deviations of ``PARAMETERS``, float32 [4]."""
        rate, wind_speed, moisture = (log_deviation(each) for each in (self.rate, self.wind_speed, self.moisture))
        return torch.tensor([rate, wind_speed, self.bearing, moisture])

    def drawn(self, key: Tensor, shape: tuple[int, ...] = ()) -> Tensor:
        """Return parameters of mean 0, float32 [n, *shape, 4].

        Args:
            key: Of the draws, int64 [n].
            shape: Of the draws of each key.
        """
        return normal(key, 0, Stream.MEMBERS, (*shape, len(PARAMETERS))) * self.scales.to(key.device)
