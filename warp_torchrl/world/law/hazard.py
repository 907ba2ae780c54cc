"""The automaton in finer time, whose fires grow round."""

from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.law import LARGEST_ALPHA, Hazard


@dataclass(frozen=True, kw_only=True)
class HazardFire(Fire):
    """The automaton under ``law.Hazard``: a tick is a k-th of the paper's, and a neighbour's probability is

        p_d = 1 - exp(-h_d),   h_d = -ln(1 - min(alpha, 0.95)) / k w_d s_d / dist_d

    Every burning stage lasts k ticks, so that what a fire passes on in its life is kept, 1 - (1 - alpha)^F; fires
    grow round where the paper's grow square. Growth, lightning, regrowth and drying keep their pace as well.

    A calm fire goes a cell of forest in some 15 ticks, so that a head has room to be faster: by ``fbp``, the default,
    it goes 0.2 cells a tick at 4 m/s and 0.7 at 12, and the burned area grows with the wind. Flammabilities keep the
    ratios of the paper's hazards. ``kernel="alexandridis"``, ``refinement=8`` and the paper's ``alpha`` are fires as
    fast as the paper's, which a wind only narrows.

    Attributes:
        alpha: As ``Fire`` has it.
        kernel: As ``Fire`` has it.
        refinement: k.
        slope_gain: a [1/degree]; a fire's speed doubles every ten degrees.

    Raises:
        ValueError: If a value is out of its range, or ``wet_ticks`` times ``refinement`` over 255.
    """

    alpha: tuple[float, float, float, float, float] = (0.0, 0.02, 0.43, 0.26, 0.0)
    kernel: Literal["alexandridis", "ellipse", "fbp"] = "fbp"
    slope_gain: float = 0.115
    refinement: int = 24

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, refinement=(1, 64))
        if self.wet_for > 255:
            raise ValueError(f"wet_ticks times refinement must be at most 255, got {self.wet_for}")

    @property
    def ticks_per_stage(self) -> int:
        """Return k."""
        return self.refinement

    @property
    def law(self) -> Hazard:
        """Return how the hazards of burning neighbours make a probability."""
        return Hazard(self.refinement)

    def faster(self, alpha: Tensor, factor: Tensor) -> Tensor:
        """Return the flammability of ``factor`` times the hazard: alpha becomes 1 - (1 - alpha)^factor."""
        return -torch.expm1(torch.log1p(-alpha.clamp(max=LARGEST_ALPHA)) * factor)
