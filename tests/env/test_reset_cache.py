"""Starts made ahead are the starts that would have been made when needed."""

import torch
from tensordict import TensorDict

from tests.conftest import small_world
from warp_torchrl.env.reset_cache import ResetCache
from warp_torchrl.world.state.cells import count_trees

SEEDS = torch.tensor([10, 11, 12, 13])


class Counting:
    """Makes starts that carry their seed and episode, and notes for how many worlds it was asked."""

    def __init__(self):
        self.asked = []

    def __call__(self, seeds, episodes):
        self.asked.append(len(seeds))
        worlds = small_world().reset(seeds, episodes)
        counts = count_trees(worlds)
        return worlds, counts, TensorDict({"seed": seeds.clone(), "episode": episodes.clone()}, batch_size=seeds.shape)


def test_what_is_taken_is_the_next_episode_of_those_worlds():
    starts, episodes = ResetCache(Counting()), torch.tensor([1, 1, 1, 1])
    for index in ([2], [0, 1], [2], [2, 3], [1]):  # world 2 twice before world 3 at all
        worlds, counts, seen = starts.pop(torch.tensor(index), SEEDS, episodes)
        assert seen["seed"].tolist() == SEEDS[index].tolist()
        assert seen["episode"].tolist() == episodes[index].tolist()
        wanted = small_world().reset(SEEDS[index], episodes[index])
        assert torch.equal(worlds.cells, wanted.cells) and torch.equal(worlds.key, wanted.key)
        assert torch.equal(counts.initial, count_trees(wanted).initial)
        episodes = episodes.index_add(0, torch.tensor(index), torch.ones(len(index), dtype=torch.int64))


def test_all_that_are_missing_are_made_at_once():
    make = Counting()
    starts, episodes = ResetCache(make), torch.zeros_like(SEEDS)
    for world in (0, 1, 2, 0):
        starts.pop(torch.tensor([world]), SEEDS, episodes)
    assert make.asked == [4, 3]


def test_forgotten_resets_are_made_anew():
    make = Counting()
    starts = ResetCache(make)
    starts.pop(torch.tensor([0]), SEEDS, torch.zeros_like(SEEDS))
    starts.clear()
    *_, seen = starts.pop(torch.tensor([1]), SEEDS + 5, torch.zeros_like(SEEDS))
    assert make.asked == [4, 4] and seen["seed"].tolist() == [16]


def test_what_was_taken_stays_as_it_is():
    starts, episodes = ResetCache(Counting()), torch.zeros_like(SEEDS)
    *_, seen = starts.pop(torch.tensor([0]), SEEDS, episodes)
    starts.pop(torch.tensor([0]), SEEDS, episodes + 1)
    assert seen["episode"].tolist() == [0]
