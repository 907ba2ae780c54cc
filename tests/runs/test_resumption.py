"""An edit of a run's config.yaml is told by its values, not by how it is written."""

import pytest
import yaml

from tests.runs.test_checkpoint import SIGNATURE
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain, without_targets
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.runs.resumption import _other_classes, edits, read_config, resumption

NOT_RECORDED = ("resume", "debug")


@pytest.fixture(scope="module")
def written():
    """What a run writes into its config.yaml, and what its checkpoints hold."""
    config = plain(compose_config("train", ["landscape=raster", "landscape.path=x", "landscape.table={11:3}"]))
    record = {key: value for key, value in without_targets(config).items() if key not in NOT_RECORDED}
    record["landscape"]["table"] = {"11": 3}  # JSON has texts alone for keys
    return config, record


def edited(written, path, text, old, new):
    config, record = written
    path.write_text(yaml.safe_dump(config) if text is None else text)
    if old:
        assert old in path.read_text()
        path.write_text(path.read_text().replace(old, new, 1))
    return edits(read_config(path), record)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("", ""),
        ("\nseed: 0\n", "\n\n# a comment\nseed:    0 # another\n"),
        ("learning_rate: 0.001\n", "learning_rate: 1e-3\n"),
        ("n_worlds: 256\n", "n_worlds: 256.0\n"),
        ("total_frames: 2000000\n", "total_frames: 4000000\n"),
        ("debug: false", "debug: true"),
    ],
)
def test_what_is_written_another_way_is_no_edit(written, tmp_path, old, new):
    assert edited(written, tmp_path / "config.yaml", None, old, new) == []


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("gamma: 0.99\n", "gamma: 0.9\n", "algorithm.gamma is 0.9 and was 0.99"),
        ("\nseed: 0\n", "\nseed: 1\n", "seed is 1 and was 0"),
        ("\nseed: 0\n", "\n", "seed is not there and was 0"),
        ("\nseed: 0\n", "\nseed: 0\nsede: 3\n", "sede is 3 and was not there"),
        ("compile: false", "compile: 0", "compile is 0 and was False"),
        ("scenario: skirmish", "scenario: single", "scenario is 'single' and was 'skirmish'"),
        ("    11: 3", "    11: 4", "landscape.table.11 is 4 and was 3"),
        ("\nseed: 0\n", "\nseed: ${n_worlds}\n", "seed is '${n_worlds}' and was 0"),
        ("\nseed: 0\n", "\nseed: [" + "9, " * 500 + "9]\n", "seed is [9, 9, 9, 9, 9, 9, ...] and was 0"),
    ],
)
def test_another_value_is_told_with_its_key(written, tmp_path, old, new, told):
    assert edited(written, tmp_path / "config.yaml", None, old, new) == [told]


def test_another_class_of_the_same_fields_is_told_and_another_module_is_not(written):
    config, _ = written
    moved = {**config, "wind": {**config["wind"], "_target_": "warp_torchrl.wind.Uniform"}}
    other = {**config, "wind": {**config["wind"], "_target_": "warp_torchrl.world.air.wind.Calm"}}
    renamed = {**config, "collector": {**config["collector"], "_target_": "warp_torchrl.collectors.Direct"}}
    assert _other_classes(moved, config) == _other_classes(renamed, config) == []
    assert _other_classes(other, config) == ["wind is Calm and was Uniform"]


def test_a_group_that_is_newer_than_the_run_is_no_edit(written):
    config, record = written
    before = {key: value for key, value in config.items() if key != "curriculum"}
    assert _other_classes(before, config) == []
    assert edits(before, {key: value for key, value in record.items() if key != "curriculum"}) == []
    assert edits(before, record) == ["curriculum is not there and was {}"]


@pytest.mark.parametrize(
    "text", ["[1, 2]", "a: [", "seed: !!python/object/apply:os.system [id]", "x" * 2_000_000, "", "a: &a [1]\nb: *a"]
)
def test_what_is_no_configuration_is_refused_in_one_line(tmp_path, text):
    (tmp_path / "config.yaml").write_text(text)
    with pytest.raises(ConfigError, match=r"config\.yaml must be as the run wrote it") as error:
        read_config(tmp_path / "config.yaml")
    assert "\n" not in str(error.value)
    assert read_config(tmp_path / "none.yaml") == {}


def test_a_new_total_must_be_more_than_what_was_trained_and_the_former_one_is_none(tmp_path):
    config = plain(compose_config("train", ["total_frames=64"]))
    values = {key: value for key, value in without_targets(config).items() if key not in NOT_RECORDED}
    record, path = SavedConfig(choices={}, values=values), tmp_path / "config.yaml"
    path.write_text(text := yaml.safe_dump(config))
    options = {"scenario": "skirmish", "signature": SIGNATURE, "policy": {}, "training": {}, "keep": 3}
    checkpoints.save(tmp_path, frames=64, mode="sampled", saved_config=record, **options)
    assert resumption(tmp_path).total_before == 64, "its own total is reached, and it goes on to its evaluation"
    told = "total_frames must be more than the 64 that .* has had, got 64"
    with pytest.raises(ConfigError, match=told):
        resumption(tmp_path, 64)
    for total in (32, 96):
        path.write_text(text.replace("total_frames: 64", f"total_frames: {total}"))
        if total == 32:
            with pytest.raises(ConfigError, match=told.replace("got 64", "got 32")):
                resumption(tmp_path)
    assert resumption(tmp_path).run_config.total_frames == 96
