"""Samples are what TorchRL's storage gives."""

import pytest
import torch
from tensordict import TensorDict
from torchrl.data import LazyTensorStorage, SamplerWithoutReplacement, TensorDictReplayBuffer

from warp_torchrl.algorithms.storage import BatchStorage, RowStorage
from warp_torchrl.benchmark.waits import counted_waits
from warp_torchrl.system.device import unread

TRANSITIONS = TensorDict(
    agents=TensorDict(
        view=torch.randint(256, (6, 3, 2, 5), dtype=torch.uint8), reward=torch.rand(6, 3), batch_size=[6, 3]
    ),
    done=torch.tensor([[False], [True]] * 3),
    batch_size=[6],
)


def filled(kind, capacity):
    storage = kind(capacity)
    storage.set(range(6), TRANSITIONS)
    return storage


@pytest.mark.parametrize("capacity", [6, 9])
@pytest.mark.parametrize(
    "index",
    [
        torch.tensor([4, 0, 0, 5]),
        torch.tensor([], dtype=torch.int64),
        torch.tensor([True, False, False, True, True, False]),
        torch.tensor([[1, 2], [3, 4]]),
        torch.tensor(3),
        slice(1, 4),
        [5, 2],
        2,
    ],
    ids=str,
)
def test_samples_are_what_torchrls_storage_gives(capacity, index):
    theirs, ours = filled(LazyTensorStorage, capacity).get(index), filled(RowStorage, capacity).get(index)
    assert ours.batch_size == theirs.batch_size and ours["agents"].batch_size == theirs["agents"].batch_size
    assert set(ours.keys(True, True)) == set(theirs.keys(True, True))
    for key in theirs.keys(True, True):
        assert torch.equal(ours[key], theirs[key]) and ours[key].dtype == theirs[key].dtype, key


@pytest.mark.parametrize(
    "cursor",
    [torch.arange(6), torch.tensor([7, 8, 0, 1, 2, 3]), torch.tensor([5, 4, 3, 2, 1, 0]), torch.arange(3, 9)],
    ids=str,
)
def test_what_is_put_in_lies_where_torchrls_storage_puts_it(cursor):
    theirs, ours = LazyTensorStorage(9), RowStorage(9)
    later = TRANSITIONS.clone()
    later["done"] = ~later["done"]
    for storage in (theirs, ours):
        storage.set(range(9), torch.cat((TRANSITIONS, TRANSITIONS[:3])))
        storage.set(cursor, later)
    assert len(ours) == len(theirs)
    for key in theirs[:].keys(True, True):
        assert torch.equal(ours[:][key], theirs[:][key]), key


@pytest.mark.parametrize(("cursor", "put_at"), [([3, 4, 5, 6, 7, 8], slice(3, 9)), ([8, 3, 4, 5, 6, 7], None)])
def test_rows_in_order_are_put_in_as_a_slice(monkeypatch, cursor, put_at):
    given = []
    monkeypatch.setattr(LazyTensorStorage, "set", lambda storage, cursor, *_, **options: given.append(cursor))
    RowStorage(9).set(torch.tensor(cursor), TRANSITIONS)
    assert given == [put_at] if put_at else torch.equal(given[0], torch.tensor(cursor))


def test_what_was_put_in_is_a_copy():
    storage, given = RowStorage(6), TRANSITIONS.clone()
    storage.set(torch.arange(6), given)
    given["agents", "view"].zero_()
    assert torch.equal(storage[:]["agents", "view"], TRANSITIONS["agents", "view"])


def test_a_sample_is_a_copy():
    storage = filled(RowStorage, 6)
    storage.get(torch.tensor([1, 2]))["agents", "view"].zero_()
    assert torch.equal(storage.get(torch.arange(6))["agents", "view"], TRANSITIONS["agents", "view"])


def test_nothing_is_taken_of_an_empty_storage():
    with pytest.raises(RuntimeError):
        RowStorage(6).get(torch.tensor([0]))


def test_a_batch_lies_in_the_first_rows_though_no_cursor_is_read():
    buffer = TensorDictReplayBuffer(storage=BatchStorage(6), sampler=SamplerWithoutReplacement())
    for batch in (TRANSITIONS, TRANSITIONS[2:], TRANSITIONS[:3]):
        buffer.empty()
        with counted_waits("cpu") as waits, unread():
            buffer.extend(batch.clone())
        assert len(buffer) == len(batch) and (buffer[:].exclude("index") == batch).all()
    assert not waits.places


def test_a_batch_beside_another_is_put_where_it_is_told():
    storage = BatchStorage(6)
    for cursor in (torch.arange(4), torch.arange(4, 6)):
        storage.set(cursor, TRANSITIONS[cursor])
    assert len(storage) == 6 and (storage.get(torch.arange(6)) == TRANSITIONS).all()
