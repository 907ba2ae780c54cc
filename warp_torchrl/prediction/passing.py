"""How a fire passed through each cell: its rate, intensity and flame length when it came.

The rate of spread of a front, across itself, is 1 / |grad T| of its arrival times T. Byram's intensity goes with that
rate along the whole perimeter (Catchpole, de Mestre and Gill 1982), and the flame length with its power of 0.46 (Byram
1959):

    I = I_head R / R_head,    L = L_head (R / R_head)^0.46
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.rates.spread import Spread
from warp_torchrl.world.travel import NEVER

_LEAST = 1e-9


@dataclass(frozen=True, eq=False)
class Behaviour:
    """What fire does in each cell in each spell of weather; all float32 [T, H W] but ``ends``."""

    ends: Tensor  # when each spell ends, float32 [T] [minutes]
    head: Tensor  # rate of spread of the head [m/min]
    backing: Tensor  # and of the rear
    intensity: Tensor  # fireline intensity at the head [kW/m]
    flame_length: Tensor  # at the head [m]

    @classmethod
    def of(cls, spreads: Sequence[Spread], minutes: Sequence[float]) -> "Behaviour":
        """Return the behaviour of the heads [1, H, W] in spells of so many minutes.

        The rear goes at R_head (1 - e) / (1 + e), e the eccentricity of the ellipse.
        """
        focus = torch.stack([(1.0 - each.length_to_breadth[0].pow(-2)).clamp(min=0.0).sqrt() for each in spreads])
        head = torch.stack([each.head[0] for each in spreads])
        return cls(
            ends=torch.tensor(minutes, dtype=torch.float64).cumsum(0).to(torch.float32),
            head=head.flatten(1),
            backing=(head * (1.0 - focus) / (1.0 + focus)).flatten(1),
            intensity=torch.stack([each.intensity[0] for each in spreads]).flatten(1),
            flame_length=torch.stack([each.flame_length[0] for each in spreads]).flatten(1),
        )


def passing(arrival: Tensor, pace: Tensor, behaviour: Behaviour, cell_size: float) -> tuple[Tensor, Tensor, Tensor]:
    """Return rate [m/min], intensity [kW/m] and flame length [m] of fires as they came, float32 [B, H, W] each.

    The rate is held between those of the rear and of the head in the weather in which the fire came: near its start a
    fire is smaller than a cell, and differences between cells do not tell its rate. Where the fire did not come, or was
    lit, they are 0.

    Args:
        arrival: When the fire reached each cell, float32 [B, H, W] [minutes]; ``travel.NEVER`` where it did not.
        pace: Factor on the fire's times, float32 [B, H, W].
        behaviour: Of the heads.
        cell_size: Side of a cell [m].
    """
    came = (arrival > 0.0) & (arrival < NEVER / 2)
    spell = torch.bucketize(arrival, behaviour.ends).clamp(max=len(behaviour.ends) - 1).flatten(1)

    def then(values: Tensor) -> Tensor:
        return values.gather(0, spell).view(arrival.shape)

    head, backing = then(behaviour.head), then(behaviour.backing)
    rate = cell_size / steepness(arrival).clamp(min=_LEAST)
    rate = torch.minimum(torch.maximum(rate, backing / pace), head / pace) * came
    share = rate / head.clamp(min=_LEAST)
    return rate, then(behaviour.intensity) * share, then(behaviour.flame_length) * share.pow(0.46)


def steepness(arrival: Tensor) -> Tensor:
    """Return |grad T| of arrival times, float32 [B, H, W] [minutes a cell], from the cells that came before.

    The steeper of two estimates: of the differences to the earlier neighbour in the row and in the column, and of that
    to the earliest across a corner. Neither is over the true one where T is linear, and one of them is right where fire
    comes along a row, a column or a diagonal.
    """
    around = pad(arrival, (1, 1, 1, 1), value=NEVER)
    row = torch.minimum(around[:, 1:-1, :-2], around[:, 1:-1, 2:])
    column = torch.minimum(around[:, :-2, 1:-1], around[:, 2:, 1:-1])
    above = torch.minimum(around[:, :-2, :-2], around[:, :-2, 2:])
    corner = torch.minimum(above, torch.minimum(around[:, 2:, :-2], around[:, 2:, 2:]))
    straight = torch.hypot((arrival - row).clamp(min=0.0), (arrival - column).clamp(min=0.0))
    return torch.maximum(straight, (arrival - corner).clamp(min=0.0) * 0.5**0.5)
