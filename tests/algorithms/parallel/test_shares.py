"""What each of several processes takes of a batch, a minibatch and a memory: its share, and not the whole."""

import pytest
import torch

from tests.demonstrations.played import played
from warp_torchrl.algorithms.parallel import group
from warp_torchrl.demonstrations.files import save_recording
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.training.learning import Learning

SMALL = ("scenario=skirmish", "n_worlds=4", "collector.steps=8", "collector.grows_at=0", "horizon=16", "processes=2")
SIZES = ("model.actor_hidden=[8]", "model.critic_hidden=[8]", "algorithm.minibatch_size=16")


class OneOfTwo:
    """A group of two processes of which the other has what this one has."""

    rank, size = 1, 2

    def sum_(self, tensor):
        tensor.mul_(2)

    def close(self):
        pass


@pytest.fixture
def learning():
    def make(*overrides):
        return Learning(run_config(plain(compose_config("train", [*SMALL, *SIZES, *overrides]))))

    group.enter(OneOfTwo())
    yield make
    group.leave()


def samples(made):
    made.learner.store(next(made.batches())[0])
    return list(made.learner.samples())


def test_a_process_has_its_worlds_and_draws_its_share_of_each_minibatch(learning):
    made = learning("algorithm=mappo", "algorithm.epochs=2")
    assert made.env.seeds.tolist() == [2, 3] and made.frames_per_batch == 32
    assert [len(each) for each in samples(made)] == [8, 8, 8, 8]  # of 16 steps, twice


def test_a_process_has_its_share_of_the_memory_and_waits_for_its_share_of_the_warm_up(learning):
    made = learning("algorithm=dqn", "algorithm.capacity=40", "algorithm.warm_up=32", "algorithm.updates=3")
    assert [len(each) for each in samples(made)] == [8, 8, 8]  # 16 steps of the 32 that both have
    assert made.run_config.algorithm.memory(torch.device("cpu"))._storage.max_size == 20
    later = learning("algorithm=dqn", "algorithm.warm_up=34")
    assert not samples(later)


def test_a_process_draws_its_share_of_what_people_did(learning, tmp_path):
    save_recording(played("horizon=16"), tmp_path)
    made = learning("algorithm=mappo", f"imitation.demonstrations={tmp_path}", "imitation.minibatch_size=32")
    assert made.learner.keeps["demonstrations"].size == 16
