"""Trained policies that teach."""

import pytest
import torch

from tests.training.test_kickstarting import configured, sample_of
from tests.world.mechanics.there import needs
from warp_torchrl.api.make import make_env
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.heuristics.heuristic import instructor
from warp_torchrl.models import ACTION, ACTION_MASK, TEACHER_ACTION
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.runs.policies.load import load_policy
from warp_torchrl.training.loop import Training
from warp_torchrl.training.teachers import TrainedTeacher, teacher


def student(folder, *overrides):
    return Training(configured("imitation.teacher=skirmish", *overrides), SavedConfig(), folder)


def test_a_trained_teacher_judges_by_what_it_was_trained_to_see(tmp_path):
    training = student(tmp_path, "observation=local", "observation.radius=2")
    policy = load_policy("skirmish")
    own = make_env("skirmish", n_worlds=8, overrides=[*policy.overrides, "landscape.size=12", "horizon=20"])
    now, told = training.env.reset(), set()
    for _ in range(6):
        expected = policy(own.set_state(training.env.world_state))[ACTION]
        training.learner.explore(now)
        assert torch.equal(now[TEACHER_ACTION], expected)
        assert not torch.equal(now[ACTION], expected), "the student acts"
        told |= set(expected.flatten().tolist())
        now = training.env.step(now)["next"]
    assert len(told) > 3


@pytest.mark.slow
def test_what_it_says_is_cloned(tmp_path):
    training = student(tmp_path, "imitation.until=1.0")
    first = float(training.learner.terms(sample_of(training))["loss_bc"].detach())
    for batch in training.collection:
        training._learn([batch])
        if training.frames >= 320:
            break
    assert float(training.learner.terms(sample_of(training))["loss_bc"].detach()) < 0.9 * first


def test_a_run_goes_on_with_the_teacher_that_it_had(tmp_path):
    training = student(tmp_path)
    kept = training.tasks[0].state_dict()
    training.tasks[0].load_state_dict(kept)
    kept["keeps"]["teacher"]["digest"] = "0" * 64
    with pytest.raises(ConfigError, match=r"imitation\.teacher has other weights than when this run began"):
        training.tasks[0].load_state_dict(kept)


def test_a_run_folder_may_teach_and_a_heuristic_is_itself(weak_run):
    env = make_env("skirmish", n_worlds=3)
    shown = env.reset()
    assert isinstance(teacher(str(weak_run), env), TrainedTeacher)
    simple = teacher("greedy", env)
    assert type(simple) is HEURISTICS["greedy"]
    assert torch.equal(simple(shown.clone())[ACTION], simple.choose(env.world_state, shown[ACTION_MASK]))


@needs("sensing")
@pytest.mark.parametrize("source", ["teacher", "guide"])
@pytest.mark.parametrize("privileged", [True, False])
def test_who_is_not_privileged_acts_on_what_the_team_knows(tmp_path, source, privileged):
    keys = ["scenario=search", "n_worlds=16", f"imitation.privileged={str(privileged).lower()}"]
    keys += [f"imitation.{source}=dispatch", *(["algorithm=dqn"] if source == "guide" else [])]
    learner, env = (training := student(tmp_path, "imitation.teacher=null", *keys)).learner, training.env
    now, plays, sees = env.reset(), HEURISTICS["dispatch"](env), instructor(HEURISTICS["dispatch"], env)
    who = learner.explore._teacher if source == "teacher" else learner.explore._guide
    said, knows, sees = (each(now.select(ACTION_MASK).clone())[ACTION] for each in (who, plays, sees))
    assert torch.equal(said, sees if privileged else knows)
    assert not torch.equal(sees, knows), "fires are out of sight"


KINDS = "mixture.kinds={a:{scenario:single},b:{scenario:skirmish,teacher:nobody}}"


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (["imitation.teacher=skirmishes"], r"imitation\.teacher must be null or one of .*: did you mean skirmish"),
        (["mixture=several", KINDS], r"mixture\.kinds\.b\.teacher must be null or one of .*, got nobody"),
        (["imitation.teacher=null", "imitation.guide=skirmish", "algorithm=dqn"], r"imitation\.guide must be null or"),
    ],
)
def test_a_teacher_that_is_not_there_is_named_in_one_line(overrides, said):
    with pytest.raises(ConfigError, match=said) as error:
        _ = configured("imitation.teacher=greedy", *overrides).kinds
    assert "\n" not in str(error.value)


def test_a_teacher_that_remembers_or_does_not_fit_is_refused(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    config = configured("model.memory=8", "total_frames=64", "evaluation.mode=sampled")
    record = SavedConfig(
        choices={"algorithm": "mappo", "reward": "efficiency", "observation": "guided", "scenario": "skirmish"},
        values={"model": {"memory": 8, "actor_hidden": [16], "critic_hidden": [16]}, "seed": 0},
    )
    Training(config, record, folder).train()
    with pytest.raises(ConfigError, match=r"imitation\.teacher must neither remember nor talk, and .*run does"):
        teacher(str(folder), make_env("skirmish", n_worlds=2))
    with pytest.raises(ConfigError, match="does not fit here"):
        teacher("skirmish", make_env("skirmish", n_worlds=1, overrides=["team.allow_stay=false"]))
