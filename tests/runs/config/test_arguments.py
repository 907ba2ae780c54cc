"""Arguments that compose a saved configuration again."""

import pytest

from warp_torchrl.runs.checkpoint import CheckpointError
from warp_torchrl.runs.config import arguments
from warp_torchrl.runs.config.arguments import keys_of_networks
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.policies.named_policy import NamedPolicy
from warp_torchrl.runs.transfer import check_start
from warp_torchrl.training.checks import check_training


def composed(*overrides):
    return plain(compose_config("train", overrides))


@pytest.mark.parametrize(
    ("value", "literal"),
    [
        (None, "null"), (True, "true"), (0.5, "0.5"), (1e-05, "1e-05"), ("text", "text"), ("null", "'null'"),
        ("3", "'3'"), ([64, 64], "[64,64]"), (["a b", None], "['a b',null]"), ("a'b\\", "'a\\'b\\\\'"),
    ],
)  # fmt: skip
def test_values_are_written_as_hydra_reads_them(value, literal):
    assert arguments.literal(value) == literal
    assert plain(compose_config("train", [f"+own={literal}"]))["own"] == value


@pytest.mark.parametrize("given", [(), ("observation=surroundings", "observation.radius=2")])
def test_a_refused_start_names_the_keys_with_which_it_is_none(given):
    start = ("start_from=warp_v1", *given)
    with pytest.raises(CheckpointError, match="as there: ") as refused:
        check_training(composed(*start), ())
    keys = str(refused.value).partition("as there: ")[2].split()
    assert ("observation=surroundings" in keys) == (not given)
    assert {"observation.near=4", "observation.advice=dispatch", "model.actor_hidden=[256,256]"} <= set(keys)
    values = composed(*start, *keys)
    found = NamedPolicy("warp_v1").checkpoint
    check_start(run_config(values), found)
    assert keys_of_networks(found.saved_config(), values) == []


@pytest.mark.parametrize("given", ["algorithm=dqn", "team.allow_stay=false"])
def test_keys_are_named_where_they_mend_a_refusal_alone(given):
    with pytest.raises(CheckpointError, match=r"holds a policy alone|actions is") as refused:
        check_training(composed("start_from=warp_v1", given), ())
    assert "as there" not in str(refused.value)


def test_what_is_matched_by_name_is_no_such_key():
    found = NamedPolicy("warp_v1").checkpoint.saved_config()
    seen = ("experiment=warp_v1", "scenario=scouts", "observation.features=[burn_probability]", "belief=ensemble")
    assert keys_of_networks(found, composed(*seen)) == []
