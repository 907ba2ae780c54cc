"""Keys that had another name are read once more, and told."""

import json
import logging
import shutil

import pytest

from tests.test_golden import GOLDEN
from warp_torchrl.runs.checkpoint import newest
from warp_torchrl.runs.config.compose import compose_config, plain
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.renamed import RENAMED, renamed_overrides, renamed_values
from warp_torchrl.runs.config.saved_config import SavedConfig, restore
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.runs.resumption import read_config
from warp_torchrl.validation import dotted


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("model.facing=north", "model.symmetry=none"),
        ("model.facing=fire", "model.symmetry=canonical"),
        ("model.facing=north,fire", "model.symmetry=none,canonical"),
        ("model.facing=up", "model.symmetry=up"),
        ("team.radio_range=3,5", "team.radio.range=3,5"),
    ],
)
def test_an_old_key_is_read_and_told_once(old, new, caplog):
    with caplog.at_level(logging.WARNING, logger="warp_torchrl"):
        assert renamed_overrides(["seed=1", old]) == ["seed=1", new]
        assert renamed_overrides(["seed=1", new]) == ["seed=1", new]
    assert [record.getMessage() for record in caplog.records] == [
        f"{old} is now {new}; the old name goes with the next release"
    ]


def test_a_configuration_is_composed_with_an_old_key():
    assert plain(compose_config("train", ["model.facing=north"]))["model"]["symmetry"] == "none"


def test_values_of_run_folders_keep_their_order_and_get_the_names_of_now():
    values = {"seed": 1, "model": {"sharing": "team", "facing": "north", "memory": 0}}
    found = renamed_values(values)
    assert found == {"seed": 1, "model": {"sharing": "team", "symmetry": "none", "memory": 0}}
    assert list(found["model"]) == ["sharing", "symmetry", "memory"] and "facing" in values["model"]
    assert renamed_values({"model": None}) == {"model": None}


def test_values_that_stand_one_level_deeper_now_are_put_there():
    team = {
        "n_agents": 3,
        "messages": "map",
        "radio_range": 4.0,
        "radio_loss": 0.1,
        "start": "corner",
    }
    found = renamed_values({"team": team})["team"]
    assert found == {
        "n_agents": 3,
        "radio": {"carries": "map", "range": 4.0, "loss": 0.1},
        "start": "corner",
    }
    assert list(found) == ["n_agents", "radio", "start"] and "messages" in team
    assert renamed_values({"team": found})["team"] == found
    assert renamed_values({"team": {"radio_range": [1]}}) == {"team": {"radio": {"range": [1]}}}


@pytest.mark.parametrize(
    "both", [{"team": {"radio": 5, "radio_range": 3}}, {"model": {"facing": "up", "symmetry": "none"}}]
)
def test_an_old_name_beside_its_new_one_is_refused(both):
    assert renamed_values(both) == both
    with pytest.raises(ConfigError, match=r"(radio_range|facing) in the run folder is not a key of this version"):
        restore(SavedConfig(values=renamed_values(both)))


def test_a_former_team_is_restored_and_an_override_by_an_old_name_counts():
    values = renamed_values({"team": {"messages": "map", "radio_range": 4.0}})
    record = SavedConfig(choices={"scenario": "scouts"}, values=values)
    team = plain(restore(record, ["team.radio_range=7"]))["team"]
    assert team["radio"] == {"carries": "map", "range": 7, "loss": 0.0, "line_of_sight": False, "delay": 0}


def test_shipped_and_former_runs_are_read_by_the_names_of_now(tmp_path):
    record = newest(find_policy("skirmish"))[0].saved_config()
    assert record.values["model"]["symmetry"] == "canonical" and "facing" not in record.values["model"]
    assert plain(restore(record))["model"]["symmetry"] == "canonical"
    former = newest(shutil.copytree(GOLDEN / "0.1.0", tmp_path / "run"))[0].saved_config()
    assert plain(restore(former))["model"]["symmetry"] == "none", "there was no symmetry in 0.1.0"
    (tmp_path / "config.yaml").write_text(json.dumps({"model": {"facing": "fire"}}))
    assert read_config(tmp_path / "config.yaml") == {"model": {"symmetry": "canonical"}}


def test_every_new_name_is_a_key():
    keys = dotted(plain(compose_config("train")))
    assert all(new in keys and old not in keys for old, (new, _) in RENAMED.items())
