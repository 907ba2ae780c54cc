"""What processes tell each other: two of them, and one alone."""

import multiprocessing
from queue import Empty

import pytest
import torch
from torchrl.modules import PopArtValueNorm

from warp_torchrl.algorithms import parallel
from warp_torchrl.algorithms.parallel import WorkerDied, group
from warp_torchrl.algorithms.parallel.sockets import Sockets, pairs
from warp_torchrl.algorithms.ppo import SharedValueNorm
from warp_torchrl.training.reward_scale import RewardScale

BATCH = torch.arange(24.0).reshape(6, 2, 2, 1).sin()  # [B, T, A, 1]; each of two processes has half


def part_of(values, rank):
    return values.chunk(2)[rank]


def talk(rank):
    """Everything that a process says and hears, as plain values."""
    own = part_of(BATCH, rank)
    norm, scale = SharedValueNorm(shape=1), RewardScale(gamma=0.9)
    norm.learn(norm.moments([own])[0])
    scale._add(own.double())
    several = [torch.full((2, 2), float(rank)), torch.tensor(10.0 * rank)]
    parallel.mean_(several)
    return {
        "size": parallel.size(),
        "rank": parallel.rank(),
        "sum": parallel.sum_(torch.tensor([1.0 + rank])).tolist(),
        "means": [each.tolist() for each in several],
        "shared": parallel.share({"from": rank, "of": (own,)})["of"][0].tolist(),
        "gathered": parallel.gather(rank),
        "standardised": [each.tolist() for each in parallel.standardised([own, 2.0 * own[:1]], dim=-2)],
        "norm": [each.item() for each in norm.buffers()],
        "moments": scale._moments.tolist(),
    }


def other(rank, end, answers):
    torch.set_num_threads(1)
    group.enter(Sockets(rank, 2, [end]))
    answers.put(talk(rank))
    parallel.gather(None)  # so that neither ends before the other has heard it


@pytest.fixture(scope="module")
def said():
    """What this process, which is the first, and another one have said."""
    context = multiprocessing.get_context("spawn")
    answers, ((own,), (given,)) = context.Queue(), pairs(1)
    second = context.Process(target=other, args=(1, given, answers), daemon=True)
    second.start()
    given.close()  # so that this process hears of the other's end
    group.enter(Sockets(0, 2, [own]))
    try:
        first = talk(0)
        parallel.gather(None)
        found = answers.get(timeout=60)
    except (WorkerDied, Empty):
        pytest.fail("the other process did not answer")
    finally:
        group.leave()
    second.join(30)
    return [first, found]


def test_processes_know_how_many_they_are(said):
    assert [(each["rank"], each["size"]) for each in said] == [(0, 2), (1, 2)]


def test_sums_and_means_are_of_both(said):
    for each in said:
        assert each["sum"] == [3.0]
        assert each["means"] == [[[0.5, 0.5], [0.5, 0.5]], 5.0]


def test_the_first_shares_and_gathers(said):
    assert [each["shared"] for each in said] == 2 * [part_of(BATCH, 0).tolist()]
    assert [each["gathered"] for each in said] == [[0, 1], []]


def test_parts_are_standardised_by_the_moments_of_the_whole(said):
    for index, given in enumerate((BATCH, 2.0 * BATCH[::3])):  # each process has told of the first world of its own
        whole = torch.cat([torch.tensor(each["standardised"][index]) for each in said])
        mean, deviation = given.mean((0, 1), keepdim=True), given.std((0, 1), keepdim=True)
        torch.testing.assert_close(whole, (given - mean) / deviation, atol=1e-6, rtol=0)
        torch.testing.assert_close(parallel.standardised([given], dim=-2)[0], whole, atol=1e-6, rtol=0)


def test_norms_of_values_and_rewards_are_those_of_the_whole(said):
    norm, scale = PopArtValueNorm(shape=1), RewardScale(gamma=0.9)
    norm.update(BATCH)
    scale._add(BATCH.double())
    for each in said:
        assert each["norm"] == pytest.approx([each.item() for each in norm.buffers()], rel=1e-5)
        assert each["moments"] == pytest.approx(scale._moments.tolist(), rel=1e-9)


def test_one_process_talks_to_nobody():
    alone = talk(0)
    assert (alone["size"], alone["rank"]) == (1, 0)
    assert (alone["sum"], alone["means"], alone["gathered"]) == ([1.0], [[[0.0, 0.0], [0.0, 0.0]], 0.0], [0])


@pytest.mark.parametrize(
    ("threads", "worlds", "count"),
    [(1, 256, 1), (2, 256, 2), (4, 256, 4), (3, 256, 2), (8, 256, 4), (8, 64, 1), (4, 255, 3)],
)
def test_auto_takes_what_shares_the_worlds_and_leaves_enough(monkeypatch, threads, worlds, count):
    monkeypatch.setattr(torch, "get_num_threads", lambda: threads)
    assert parallel.automatic(worlds, torch.device("cpu")) == count
