"""What aircraft are bound by, where a team's options say so: the distance that they keep."""

import torch
from torch import Tensor

from warp_torchrl.world.state import Vehicles


def near_misses(vehicles: Vehicles, flies: Tensor, separation: float | None, running: Tensor) -> Tensor | None:
    """Return the near misses of each agent after the moves of a step, int32 [B, A]; None where they are not counted.

    An aircraft has one if it ends the step nearer to another aircraft than ``separation``, by Euclidean distance.

    Args:
        vehicles: The team after its moves, with the near misses before the step.
        flies: Which agents fly, bool [A].
        separation: See ``Team`` [cells].
        running: Which worlds go on, bool [B, 1].
    """
    if separation is None or vehicles.near_misses is None:
        return vehicles.near_misses
    position = vehicles.position.to(torch.float32)
    apart = (position[:, :, None] - position[:, None]).square().sum(-1)
    others = ~torch.eye(len(flies), dtype=torch.bool, device=flies.device)
    near = ((apart < separation**2) & flies[:, None] & flies & others).any(dim=-1)
    return vehicles.near_misses + (near & running).to(torch.int32)
