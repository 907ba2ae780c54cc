"""What runs are called in the tables of a sweep."""

import pytest

from warp_torchrl.evaluation.method import method
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import SavedConfig


@pytest.mark.parametrize(
    ("overrides", "named"),
    [
        ([], "mappo efficiency guided"),
        (["algorithm=ippo", "model.sharing=none"], "ippo efficiency guided sharing=none"),
        (["model.symmetry=none", "observation.radius=7"], "mappo efficiency guided radius=7 symmetry=none"),
        (["observation=local", "observation.radius=3"], "mappo efficiency local radius=3"),
        (["model.memory=64"], "mappo efficiency guided memory=64"),
        (["observation.advice=greedy", "model.trust=0.5"], "mappo efficiency guided advice=greedy trust=0.5"),
        (
            ["observation=surroundings", "observation.rules=true", "observation.near=4"],
            "mappo efficiency surroundings near=4 rules=true",
        ),
        (
            ["mixture=all", "observation=surroundings", "observation.water=true"],
            "mappo efficiency surroundings water=true mixture=all",
        ),
        (
            ["observation.water=false", "observation.ways=[fire]"],
            "mappo efficiency guided water=false ways=[fire]",
        ),
        (["observation=paper", "observation.radius=5"], "mappo efficiency paper radius=5"),
        (["reward=paper", "reward.barrier_rule=printed"], "mappo paper guided barrier_rule=printed"),
        (["observation=paper", "imitation.teacher=local"], "mappo efficiency paper taught by local"),
        (["imitation.demonstrations=people"], "mappo efficiency guided taught by people"),
        (["reward=agency", "reward.cooperation=-1"], "mappo agency guided cooperation=-1"),
        (["reward=agency", "reward.cooperation=-1.0"], "mappo agency guided cooperation=-1"),
        (["reward=agency", "reward.cooperation=0.25"], "mappo agency guided cooperation=0.25"),
        (["model.messages=graph"], "mappo efficiency guided messages=graph"),
        (["curriculum=success"], "mappo efficiency guided curriculum=success"),
        (
            ["imitation.teacher=local", "imitation.demonstrations=people"],
            "mappo efficiency guided taught by local and people",
        ),
    ],
)
def test_a_policy_is_called_by_what_is_unusual(overrides, named):
    chosen = dict(each.split("=") for each in overrides)
    usual = {"algorithm": "mappo", "reward": "efficiency", "observation": "guided"}
    usual |= dict.fromkeys(("curriculum", "mixture"), "none")
    choices = {group: chosen.get(group, option) for group, option in usual.items()}
    record = SavedConfig(choices=choices, values=plain(compose_config("train", overrides)))
    assert method(record)[0] == named


def test_a_policy_of_an_observation_that_is_not_there_is_called_by_it_alone():
    choices = {"algorithm": "mappo", "reward": "time", "observation": "burnt"}
    assert method(SavedConfig(choices=choices, values={"observation": {"radius": 9}}))[0] == "mappo time burnt"
    assert method(SavedConfig(choices=choices | {"observation": "../x"}, values={}))[0] == "mappo time ../x"


def test_a_record_from_before_a_key_tells_nothing_of_it():
    choices = {"algorithm": "mappo", "reward": "time", "observation": "local"}
    assert method(SavedConfig(choices=choices, values={"model": {"sharing": "team"}}))[0] == "mappo time local"


def test_runs_that_are_saved_at_other_times_are_alike():
    choices = {"algorithm": "mappo", "reward": "efficiency", "observation": "surroundings"}
    plans = (
        ["checkpoint.minutes=0", "seed=3"],
        ["checkpoint.interval=7"],
        [],
        ["algorithm.gamma=0.5", "reward.gamma=0.5"],
    )
    digests = [method(SavedConfig(choices=choices, values=plain(compose_config("train", each))))[1] for each in plans]
    assert digests[0] == digests[1] == digests[2] != digests[3]
