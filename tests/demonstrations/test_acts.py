"""What people did, as networks learn from it; and recordings that do not fit, told in one line."""

from dataclasses import replace

import pytest
import torch

from tests.demonstrations.played import SMALL, played
from warp_torchrl.collection.cloning import AGENT
from warp_torchrl.demonstrations.acts import acts_of, demonstrations
from warp_torchrl.demonstrations.files import save_recording
from warp_torchrl.demonstrations.recording import MOVER, Mover
from warp_torchrl.models import ACTION, ACTION_MASK, OBSERVATION, ORIENTATION, ROLE, signature
from warp_torchrl.models.canonical import Orientation
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain


def found(folder, *overrides):
    plan = run_config(plain(compose_config("train", [*SMALL, f"imitation.demonstrations={folder}", *overrides])))
    return demonstrations(plan, plan.make_env(1, 0))


@pytest.fixture(scope="module")
def recording():
    return played()


@pytest.fixture(scope="module")
def shape():
    return signature(run_config(plain(compose_config("train", SMALL))).make_env(1, 0))


def test_acts_are_those_of_people_alone(recording, shape):
    kinds = list(Mover)
    movers = torch.arange(len(recording.steps) * 2).view(-1, 2) % len(kinds)
    recording = replace(recording, steps=recording.steps.clone().set(MOVER, movers.to(torch.uint8)))
    acts = acts_of(recording, shape)
    where = [(step, agent) for step, row in enumerate(movers.tolist()) for agent, each in enumerate(row) if each == 2]
    assert len(acts) == len(where) > 3
    for at, (step, agent) in enumerate(where):
        assert int(acts[ACTION][at, 0]) == int(recording.steps[ACTION][step, agent]) and int(acts[AGENT][at]) == agent
        for name in shape.observation:
            assert torch.equal(acts[OBSERVATION][name][at, 0], recording.steps[OBSERVATION][name][step, agent])


def test_what_a_policy_could_not_choose_is_left_out(recording, shape):
    steps = recording.steps.clone()
    steps[ACTION_MASK][3, 1, steps[ACTION][3, 1]] = False
    assert len(acts_of(replace(recording, steps=steps), shape)) == len(acts_of(recording, shape)) - 1


def test_they_are_canonical_as_observations_are(shape, tmp_path):
    several = [played(seed=seed) for seed in range(4)]
    for each in several:
        save_recording(each, tmp_path)
    acts, raw = found(tmp_path).acts, torch.cat([acts_of(each, shape) for each in several])
    orientation = Orientation(acts[ORIENTATION])
    assert len(orientation.index.unique()) > 2, "the fire is on several sides"
    assert torch.equal(acts[ACTION], orientation.action(raw[ACTION], shape.actions))
    assert torch.equal(orientation.by_action_back(acts[ACTION_MASK], shape.actions), raw[ACTION_MASK])
    assert OBSERVATION not in acts.keys(True)
    as_it_is = found(tmp_path, "model.symmetry=none").acts
    assert torch.equal(as_it_is[ACTION], raw[ACTION]) and ORIENTATION not in as_it_is.keys(True)


def test_teams_of_other_sizes_fit_where_networks_are_shared(recording, tmp_path):
    save_recording(recording, tmp_path)
    save_recording(played("team.n_agents=3"), tmp_path)
    assert len(found(tmp_path, "team.n_agents=4").acts) == len(recording.steps) * 5
    assert len(found(tmp_path, "team.n_agents=4", "model.sharing=role").acts) == len(recording.steps) * 5


def test_other_recordings_have_another_digest(recording, tmp_path):
    save_recording(recording, tmp_path)
    first, again = found(tmp_path).digest, found(tmp_path).digest
    save_recording(played(seed=8), tmp_path)
    assert first == again != found(tmp_path).digest


@pytest.mark.parametrize(
    ("recorded", "run", "said"),
    [
        ([], ["observation=paper"], "other observation entries .*: with status, view and without a single"),
        (
            ["observation.radius=2"],
            [],
            r"was recorded with the observation view's shape \(\d+, 5, 5\), and the run has",
        ),
        (["team.allow_stay=false"], [], "was recorded with other actions than the run has: without stay"),
        (["team.roles=[ugv]"], ["team.roles=[ugv,uav]", "model.sharing=none", "team.n_agents=2"], "other agents than"),
        ([], ["team.n_agents=3", "model.sharing=none"], "without bulldozer_2, and model.sharing=none has a network"),
    ],
)
def test_what_does_not_fit_is_told_in_one_line(recorded, run, said, tmp_path):
    save_recording(played(*recorded), tmp_path)
    with pytest.raises(ConfigError, match=f"imitation.demonstrations: .*{said}") as error:
        found(tmp_path, *run)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("key", [ROLE, (*OBSERVATION, "view")])
def test_a_recording_that_lacks_what_its_configuration_has_is_told(recording, key, tmp_path):
    save_recording(replace(recording, steps=recording.steps.clone().exclude(key)), tmp_path)
    with pytest.raises(ConfigError, match=f"does not hold the .*{key[-1]} that its own configuration has"):
        found(tmp_path)


def test_folders_that_teach_nothing_are_told(recording, tmp_path):
    with pytest.raises(ConfigError, match=r"imitation.demonstrations: .*holds no recording"):
        found(tmp_path / "nowhere")
    folder = save_recording(played(mover=Mover.WAITING), tmp_path)
    with pytest.raises(ConfigError, match=r"imitation.demonstrations: .*holds no act of a person"):
        found(tmp_path)
    (folder / "steps" / "agents" / "action.memmap").write_bytes(b"other")
    with pytest.raises(ConfigError, match=r"imitation.demonstrations: .*action.memmap"):
        found(tmp_path)


def test_without_a_folder_there_is_nothing(tmp_path):
    assert found("null") is None
