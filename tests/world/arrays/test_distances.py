"""Chebyshev distances on drawn maps."""

import pytest
import torch

from tests.world.arrays.test_geometry import marked
from warp_torchrl.world.arrays.distances import FAR, chebyshev_distance, distance_to_nearest, nearest


def test_distances_count_diagonal_steps_as_one() -> None:
    mask = marked("x..x. ..... .x...")
    distance = chebyshev_distance(torch.tensor([[[0, 1], [2, 4]]]), mask)
    assert distance.dtype == torch.int16
    assert distance[0, 0].tolist() == [[1, FAR, FAR, 2, FAR], [FAR] * 5, [FAR, 2, FAR, FAR, FAR]]
    assert distance[0, 1].tolist() == [[4, FAR, FAR, 2, FAR], [FAR] * 5, [FAR, 3, FAR, FAR, FAR]]


def test_the_nearest_of_equals_is_the_first_in_reading_order() -> None:
    mask = marked(".x... ...x. .x...")
    distance, index = nearest(torch.tensor([[[1, 2], [0, 4]]]), mask)
    assert distance.tolist() == [[1, 1]]
    assert index.tolist() == [[1, 8]]


def test_where_nothing_is_marked_the_nearest_is_far() -> None:
    distance, _ = nearest(torch.tensor([[[1, 2]]]), marked("..... ....."))
    assert distance.tolist() == [[FAR]]


@pytest.mark.parametrize("shape", [(5, 7), (255, 40), (40, 256), (300, 300)])
@pytest.mark.parametrize("share", [0.0, 0.001, 0.1])
def test_the_distance_to_the_nearest_is_the_least_of_all(shape: tuple[int, int], share: float) -> None:
    generator = torch.Generator().manual_seed(shape[0])
    mask = torch.rand(3, *shape, generator=generator) < share
    mask[0, -1, -1] = True  # from the opposite corner it is as far as it can be
    position = torch.stack([torch.randint(side, (3, 2), generator=generator) for side in shape], dim=-1)
    position[0, 0] = 0
    assert torch.equal(distance_to_nearest(position, mask), nearest(position, mask)[0])


def test_distances_over_the_largest_map_fit() -> None:
    mask = torch.zeros(1, 4096, 4, dtype=torch.bool)
    mask[0, 4095, 0] = True
    distance, index = nearest(torch.tensor([[[0, 3]]]), mask)
    assert (distance.item(), index.item()) == (4095, 4095 * 4)
