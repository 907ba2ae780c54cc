"""Whom a team learns from: what cannot be is refused."""

import pytest

from warp_torchrl.collection.imitation import Imitation
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain


def test_the_weight_falls_linearly_to_nothing():
    plan = Imitation(weight=2.0, until=0.5)
    assert [plan.weight_at(progress) for progress in (0.0, 0.125, 0.25, 0.5, 1.0)] == [2.0, 1.5, 1.0, 0.0, 0.0]


def test_a_weight_that_stays():
    plan = Imitation(weight=2.0, weight_end=1.0, until=0.5)
    assert [plan.weight_at(progress) for progress in (0.0, 0.125, 0.25, 0.5, 1.0)] == [2.0, 1.75, 1.5, 1.0, 1.0]


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (["algorithm=dqn"], "imitation.demonstrations must be null where the algorithm replays: choose mappo, ippo"),
        (["model.memory=8"], "imitation.demonstrations must be null where agents remember, .* model.memory=0, got 8"),
        (["imitation.minibatch_size=0"], "imitation.minibatch_size must be in"),
        (["imitation.demonstrations=[a]"], "imitation.demonstrations must be"),
    ],
)
def test_what_cannot_be_learned_is_refused_in_one_line(overrides, said):
    with pytest.raises(ConfigError, match=said) as error:
        run_config(plain(compose_config("train", ["imitation.demonstrations=people", *overrides])))
    assert "\n" not in str(error.value)
