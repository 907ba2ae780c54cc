"""Keys that had another name are read once more, and told."""

import json
import logging
import shutil

import pytest

from tests.test_golden import GOLDEN
from warp_torchrl.config.compose import compose_config, plain
from warp_torchrl.config.renamed import RENAMED, renamed_overrides, renamed_values
from warp_torchrl.config.saved_config import restore
from warp_torchrl.runs.checkpoint import newest
from warp_torchrl.runs.resumption import read_config
from warp_torchrl.runs.shipped import find_policy


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("model.facing=north", "model.symmetry=none"),
        ("model.facing=fire", "model.symmetry=canonical"),
        ("model.facing=north,fire", "model.symmetry=none,canonical"),
        ("model.facing=up", "model.symmetry=up"),
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


def test_shipped_and_former_runs_are_read_by_the_names_of_now(tmp_path):
    record = newest(find_policy("skirmish"))[0].record()
    assert record.values["model"]["symmetry"] == "canonical" and "facing" not in record.values["model"]
    assert plain(restore(record))["model"]["symmetry"] == "canonical"
    former = newest(shutil.copytree(GOLDEN / "0.1.0", tmp_path / "run"))[0].record()
    assert plain(restore(former))["model"]["symmetry"] == "none", "there was no symmetry in 0.1.0"
    (tmp_path / "config.yaml").write_text(json.dumps({"model": {"facing": "fire"}}))
    assert read_config(tmp_path / "config.yaml") == {"model": {"symmetry": "canonical"}}


def test_every_new_name_is_a_key():
    values = plain(compose_config("train"))
    for old, (new, _) in RENAMED.items():
        group, key = new.split(".")
        assert key in values[group] and old.split(".")[1] not in values[group]
