"""Where a learner explores, it does what its guide does."""

import pytest
import torch
from torchrl.envs.utils import ExplorationType, set_exploration_type

from warp_torchrl.collection.imitation import Imitation
from warp_torchrl.evaluation.method import teacher_label
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.models import ACTION, ACTION_MASK
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.training.loop import Training

TINY = ["landscape.size=12", "horizon=20", "n_worlds=64", "collector.steps=8", "total_frames=512", "algorithm=dqn"]


def configured(*overrides):
    return run_config(plain(compose_config("train", [*TINY, "model.actor_hidden=[16]", *overrides])))


@pytest.mark.parametrize("epsilon", [1.0, 0.0, 0.25])
def test_a_share_epsilon_of_the_actions_are_the_guide_s_and_the_others_the_learner_s(tmp_path, epsilon):
    training = Training(
        configured("imitation.guide=greedy", f"algorithm.epsilon={epsilon}", "algorithm.epsilon_end=0"),
        SavedConfig(),
        tmp_path,
    )
    guide = HEURISTICS["greedy"](training.env)
    now, own, by_guide, apart = training.env.reset(), 0, 0, 0
    for _ in range(20):
        mask = now[ACTION_MASK].clone()
        said = guide.choose(training.env.world_state, mask)
        with set_exploration_type(ExplorationType.DETERMINISTIC):
            alone = training.learner.policy(now.clone())[ACTION]
        training.learner.explore(now)
        assert torch.equal(now[ACTION_MASK], mask), "what is learned from is the mask of the world"
        differ = said != alone
        apart += int(differ.sum())
        own += int((now[ACTION] == alone)[differ].sum())
        by_guide += int((now[ACTION] == said)[differ].sum())
        now = training.env.step(now)["next"]
    assert own + by_guide == apart and apart > 1000
    # 4.9 deviations of a binomial of so many actions, were they drawn one by one.
    assert abs(by_guide - epsilon * apart) <= 4.9 * (2 * apart * epsilon * (1 - epsilon)) ** 0.5


def test_it_is_named_in_reports():
    assert teacher_label(SavedConfig(values={"imitation": {"guide": "clockwise"}})) == ["guided by clockwise"]


def test_what_it_cannot_guide_is_told():
    with pytest.raises(ValueError, match=r"guide must be null or one of noop, .* got greddy: did you mean greedy"):
        Imitation(guide="greddy")
    with pytest.raises(ConfigError, match=r"imitation.guide must be null where the algorithm does not explore by it"):
        configured("algorithm=mappo", "imitation.guide=greedy")
    with pytest.raises(ConfigError, match=r"imitation.guide must be null where workers collect"):
        configured("collector=process", "imitation.guide=greedy")
