"""A training that the page starts."""

import csv
import time
from pathlib import Path

import pytest

from warp_torchrl.live.crew import Refused
from warp_torchrl.live.keeping import Keeper
from warp_torchrl.live.learning import PageTraining, arguments
from warp_torchrl.live.match import Match
from warp_torchrl.runs.checkpoint import newest
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import SavedConfig, restore
from warp_torchrl.runs.policies.named_policy import NamedPolicy
from warp_torchrl.runs.transfer import check_start
from warp_torchrl.world.state.state import Action

PEOPLE, RUN = Path("people"), Path("people/runs/one")


def composed(given):
    """What a training is of; ``imitation.demonstrations`` is looked at apart."""
    return plain(compose_config("train", [each for each in given if not each.startswith(("imitation", "hydra"))]))


OTHERS = ("scenario=large", "team.n_agents=3", "seed=5")


@pytest.mark.parametrize(
    ("policy", "overrides"),
    [
        ("generalist", ()),
        ("skirmish", OTHERS),
        *(pytest.param(policy, (), marks=pytest.mark.slow) for policy in ("default", "single", "skirmish")),
        *(pytest.param(policy, OTHERS, marks=pytest.mark.slow) for policy in ("default", "generalist", "single")),
    ],
)
def test_the_policy_s_own_configuration_is_trained_in_the_scenario_that_is_played(policy, overrides):
    record = NamedPolicy(policy).checkpoint.saved_config()
    values = composed(arguments(policy, record, overrides, PEOPLE, RUN, 200_000))
    wanted = plain(restore(record, overrides))
    assert values["algorithm"].pop("learning_rate") == pytest.approx(0.2 * wanted["algorithm"].pop("learning_rate"))
    for key in ("scenario", "landscape", "team", "horizon", "observation", "reward", "model", "algorithm", "n_worlds"):
        assert values[key] == wanted[key], key
    assert values["seed"] == wanted["seed"]
    assert (values["start_from"], values["total_frames"], values["checkpoint"]["interval"]) == (policy, 200_000, 20_000)


def test_a_training_may_start_from_the_run_of_which_it_is_made(trained):
    found = newest(trained)[0]
    values = composed(arguments(str(trained), found.saved_config(), ("scenario=default",), PEOPLE, RUN, 200))
    assert values["model"]["actor_hidden"] == [16] and values["scenario"] == "default"
    check_start(run_config(values), found)


@pytest.mark.parametrize("policy", ["default", "generalist", "single", "skirmish"])
def test_the_shipped_policies_may_be_trained_too(policy):
    found = NamedPolicy(policy).checkpoint
    values = composed(arguments(policy, found.saved_config(), (), PEOPLE, RUN, 200))
    check_start(run_config(values), found)


def test_recordings_and_folder_are_named_in_hydra_s_grammar():
    record = NamedPolicy("skirmish").checkpoint.saved_config()
    given = arguments("out puts/run", record, (), Path("it's, mine"), RUN, 10)
    assert "imitation.demonstrations='it\\'s, mine'" in given and "start_from='out puts/run'" in given
    assert f"hydra.run.dir={RUN}" in given
    assert composed(given)["start_from"] == "out puts/run"


def test_what_is_of_another_machine_is_not_asked_for():
    old = NamedPolicy("skirmish").checkpoint.saved_config()
    values = {**old.values, "device": "cuda:7", "processes": 8, "compile": True, "total_frames": 10**12}
    choices = {**old.choices, "collector": "process", "logger": "wandb"}
    values["collector"] = {"steps": 16, "workers": 4}
    choices["curriculum"], choices["mixture"] = "success", "several"
    values["mixture"] = {"kinds": {"water": {"share": 2}}, "floor": 0.5}
    values["curriculum"] = {"over": {"steps_per_tick": [9, 4]}, "low": 0.1}
    made = composed(arguments("skirmish", SavedConfig(choices=choices, values=values), (), PEOPLE, RUN, 10))
    assert (made["device"], made["compile"], made["total_frames"]) == ("cpu", False, 10)
    assert "InProcess" in made["collector"]["_target_"] and made["collector"]["steps"] == 16
    assert "CsvOnly" in made["logger"]["_target_"]
    assert "NoCurriculum" in made["curriculum"]["_target_"], "a trained policy goes on in the scenario that is played"
    assert made["mixture"] == plain(compose_config("train", []))["mixture"], "and in no other"
    assert made["imitation"]["teacher"] is None, "people teach now"


# The process


@pytest.fixture
def learning(tmp_path, monkeypatch):
    monkeypatch.setattr("warp_torchrl.runs.process.MODULE", "tests.live.fake_training")
    made = PageTraining(tmp_path / "people")
    yield made
    made.close()


@pytest.fixture
def match(make_match, trained):
    return make_match(str(trained))


def until(holds):
    end = time.monotonic() + 180.0
    while not holds():
        assert time.monotonic() < end, "it took too long"
        time.sleep(0.02)


def test_a_training_is_started_followed_and_stopped(learning, match):
    assert learning.status() == "" and learning.newest() is None
    with pytest.raises(Refused, match="no policy is trained yet"):
        learning.setting(7)
    folder = learning.start(match.sides[0], match.setting, 5000)
    assert folder.parent == learning.recordings / "runs"
    until(lambda: learning.newest() == 2000)
    assert learning.status() == f"{folder} trains: 2,000 of 5,000 steps, 75% saved in training"
    with pytest.raises(Refused, match="trains: stop it first"):
        learning.start(match.sides[0], match.setting, 5000)
    setting = learning.setting(7)
    assert (setting.policy, setting.seed, setting.overrides) == (str(folder), 7, match.setting.overrides)
    learning.stop()
    until(lambda: not learning.goes_on)
    assert learning.status() == (
        f"{folder} was stopped: 2,000 of 5,000 steps, 75% saved in training; train.py resume={folder} goes on"
    )
    with pytest.raises(Refused, match="no training goes on"):
        learning.stop()
    given = (folder / "arguments.txt").read_text().splitlines()
    name, record = match.setting.policy, match.sides[0].player.checkpoint.saved_config()
    assert given == arguments(name, record, match.setting.overrides, learning.recordings, folder, 5000)


def test_a_training_ends_by_itself(learning, match):
    folder = learning.start(match.sides[0], match.setting, 1)
    until(lambda: not learning.goes_on)
    assert learning.status() == f"{folder} is trained: 2,000 of 1 steps, 75% saved in training"


def test_why_a_training_fails_is_told(learning, match):
    folder = learning.start(match.sides[0], match.setting, 2)
    until(lambda: not learning.goes_on)
    assert learning.status() == f"{folder} failed: the disk is full" and learning.newest() is None


def test_the_page_s_end_is_the_training_s_when_it_has_saved(learning, match):
    folder = learning.start(match.sides[0], match.setting, 5000)
    until(lambda: learning.newest() is not None)
    learning.close()
    assert not learning.goes_on and (folder / "saved.txt").read_text() == "all of it"


def test_what_does_not_learn_is_told(learning, make_match, match, monkeypatch):
    with pytest.raises(Refused, match="coordinated does not learn"):
        baseline = make_match("coordinated")
        learning.start(baseline.sides[0], baseline.setting, 10)
    with pytest.raises(Refused, match="steps must be in"):
        learning.start(match.sides[0], match.setting, 0)
    record = match.sides[0].player.checkpoint.saved_config()
    other = SavedConfig(choices={**record.choices, "algorithm": "qmix"}, values=record.values)
    monkeypatch.setattr("warp_torchrl.runs.checkpoint.Checkpoint.saved_config", lambda self: other)
    with pytest.raises(Refused, match="was trained by qmix: from recordings learn mappo"):
        learning.start(match.sides[0], match.setting, 10)
    assert not learning.recordings.exists()


@pytest.mark.slow
def test_what_a_person_did_is_learned_by_a_real_training(tmp_path, match):
    side, keeper = match.sides[0], Keeper(tmp_path / "people")
    side.crew.take(0, person=1)
    for step in range(20):
        side.crew.press(0, 1, int(Action.EAST if step % 2 else Action.WEST))
        match.step()
    keeper.save(side)
    learning = PageTraining(keeper.folder)
    folder = learning.start(side, match.setting, 1600)
    end = time.monotonic() + 300.0
    while learning.goes_on and time.monotonic() < end:
        time.sleep(0.2)
    assert learning.status().startswith(f"{folder} is trained: "), learning.status()
    with (folder / "metrics.csv").open() as file:
        losses = [float(row["train/cloning_loss"]) for row in csv.DictReader(file)]
    assert 0.0 < losses[4] < losses[0] and losses[-1] == 0.0, "the weight falls to 0 at three tenths"
    shown = Match(learning.setting(match.setting.seed))
    shown.step()
    assert shown.sides[0].player.frames == learning.newest() >= 1600
