"""Batches of worlds as objects."""

from dataclasses import dataclass

import pytest
import torch
from torch import Tensor

from warp_torchrl.world.arrays.batch import Batch, concatenated
from warp_torchrl.world.fires.burn import FireHistory
from warp_torchrl.world.state.state import (
    ActionResult,
    Air,
    Forecast,
    Ground,
    Landscape,
    Transition,
    TreeCounts,
    Vehicles,
    WorldState,
)


@dataclass(eq=False, repr=False)
class Inner(Batch):
    place: Tensor
    count: Tensor | None


@dataclass(eq=False, repr=False)
class Outer(Batch):
    inner: Inner
    height: Tensor
    burned: Tensor
    side: float
    slope: Tensor | None = None


def outer(first: int = 0, worlds: int = 4) -> Outer:
    along = torch.arange(first, first + worlds)
    return Outer(Inner(along[:, None] * torch.ones(2), None), along * 10, along % 2 == 0, 30.0)


def test_a_batch_has_as_many_worlds_as_its_tensors_have_rows() -> None:
    assert outer().batch_size == (4,) and Inner(torch.zeros(3, 2), None).batch_size == (3,)


def test_what_is_not_replaced_is_shared() -> None:
    batch = outer()
    other = batch.replace(height=torch.zeros(4))
    assert type(other) is Outer and other.inner is batch.inner and other.burned is batch.burned and other.side == 30.0
    assert batch.height.tolist() == [0, 10, 20, 30] and other.height.tolist() == [0.0] * 4


def test_a_field_that_there_is_not_cannot_be_replaced() -> None:
    with pytest.raises(TypeError, match="depth"):
        outer().replace(depth=torch.zeros(4))


def test_leaves_are_the_tensors_by_name() -> None:
    batch = outer()
    assert list(batch.leaves()) == ["inner.place", "height", "burned"]
    assert batch.leaves()["inner.place"] is batch.inner.place
    again = batch.with_leaves({name: leaf + 1 for name, leaf in batch.leaves().items()})
    assert again.inner.place[0].tolist() == [1.0, 1.0] and again.height[0] == 1 and again.side == 30.0
    assert again.inner.count is None and again.slope is None


def test_a_clone_shares_no_memory() -> None:
    batch = outer()
    copy = batch.clone()
    copy.inner.place.fill_(7.0)
    copy.burned.logical_not_()
    assert batch.inner.place[1].tolist() == [1.0, 1.0] and batch.burned.tolist() == [True, False, True, False]


@pytest.mark.parametrize(
    ("index", "expected"),
    [
        (torch.tensor([3, 1, 3]), [30, 10, 30]),
        (torch.tensor([True, False, False, True]), [0, 30]),
        (slice(1, 3), [10, 20]),
        (torch.tensor([], dtype=torch.int64), []),
    ],
)
def test_some_worlds_are_picked_by_index_mask_or_slice(index: Tensor | slice, expected: list[int]) -> None:
    some = outer()[index]
    assert some.height.tolist() == expected and some.batch_size == (len(expected),)
    assert some.inner.place[:, 0].tolist() == [value / 10 for value in expected] and some.side == 30.0


def test_worlds_are_put_in_the_places_of_others() -> None:
    batch = outer()
    batch[torch.tensor([2, 0])] = outer(first=7, worlds=2)
    assert batch.height.tolist() == [80, 10, 70, 30] and batch.inner.place[:, 1].tolist() == [8.0, 1.0, 7.0, 3.0]
    assert batch.burned.tolist() == [True, False, False, False]


def test_batches_are_joined_in_order() -> None:
    joined = concatenated([outer(worlds=2), outer(first=5, worlds=1)])
    assert joined.height.tolist() == [0, 10, 50] and joined.inner.place.shape == (3, 2) and joined.side == 30.0


def test_a_batch_shows_its_shapes_and_types() -> None:
    assert repr(outer()) == "Outer(inner.place: float32 [4, 2], height: int64 [4], burned: bool [4])"


def test_a_batch_moves_to_a_device() -> None:
    moved = outer().to("meta")
    assert moved.inner.place.is_meta and moved.burned.is_meta and moved.burned.dtype == torch.bool


def test_batches_are_compared_by_what_they_are_and_not_by_their_tensors() -> None:
    parts = Landscape, Ground, Air, Forecast, TreeCounts, Vehicles, ActionResult
    for kind in (*parts, WorldState, Transition, FireHistory):
        assert kind.__eq__ is object.__eq__ and kind.__hash__ is object.__hash__, kind.__name__
