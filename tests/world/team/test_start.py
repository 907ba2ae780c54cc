"""Teams start at the free cells nearest to a corner, found in a small square where it holds enough of them."""

import pytest
import torch

from warp_torchrl.world.ignition.ignition import _largest
from warp_torchrl.world.team.start import distances_to, first_free, nearest_free


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
@pytest.mark.parametrize(("size", "agents"), [((64, 64), 4), ((20, 17), 3), ((9, 30), 4), ((12, 12), 1)])
def test_a_small_square_tells_what_the_map_does(size: tuple[int, int], agents: int, share: float) -> None:
    generator = torch.Generator().manual_seed(0)
    height, width = size
    taken = torch.rand(50, height, width, generator=generator) < share
    taken[:, :, width // 2] = False  # enough are free somewhere
    corner = (torch.rand(50, 2, generator=generator) < 0.5).long()
    base = corner * torch.tensor([height - 1, width - 1])
    whole = first_free(distances_to(base, height, width), taken, agents)
    assert torch.equal(nearest_free(taken, base, agents), whole)
    assert not taken.flatten(1).gather(1, whole[..., 0] * width + whole[..., 1]).any()


@pytest.mark.parametrize("count", [1, 2, 4, 5])
def test_the_largest_are_those_of_topk(count: int) -> None:
    generator = torch.Generator().manual_seed(0)
    scores = torch.stack([torch.randperm(300, generator=generator) for _ in range(8)])
    assert torch.equal(_largest(scores, count), scores.topk(count, dim=1).values)
