"""A hundred wrong configurations are refused in one line before any work, thirty right ones accepted."""

import pytest

from tests.runs.config.test_conf import MISTAKES
from warp_torchrl.commands.command import train

pytestmark = pytest.mark.stress

INVALID = [
    *(override for override, _ in MISTAKES),
    "seed=true",
    "seed=null",
    "n_worlds=4097",
    "n_worlds=null",
    "n_worlds=1e3",
    "total_frames=0",
    "total_frames=.inf",
    "horizon=1e9",
    "horizon=null",
    "steps_per_tick=1001",
    "cell_size=0",
    "cell_size=.nan",
    "device=null",
    "device=cpu:x",
    "compile=maybe",
    "debug.more=1",
    "++team.wheels=4",
    "++more.of.this=1",
    "~fire",
    "~seed",
    "=3",
    "seed",
    "seed==3",
    "seed=3=",
    "[seed]=3",
    "fire=",
    "fire=[paper,spread]",
    "fire=../fire/paper",
    "+fire=paper",
    "fire.tau=.inf",
    "fire.beta=-1",
    "fire.alpha=[0,1]",
    "fire.alpha=high",
    "fire.neighbours=6",
    "fire.kernel=square",
    "wind=gale",
    "wind.speed=61",
    "wind.direction=.nan",
    "wind.speed=[1,2]",
    "landscape.size=4097",
    "landscape.size=[8,3]",
    "landscape.size=0x10g",
    "landscape=array",
    "landscape=raster",
    "landscape=array landscape.path=/no/such/file.npz",
    "landscape.octaves=0",
    "landscape.relief=-1",
    "landscape.scale=[20,10]",
    "team.n_agents=null",
    "team.n_agents=257",
    "team.roles=[]",
    "team.extinguish_p=1.1",
    "team.start=corners",
    "team.tank=-1",
    "ignition.radius=9",
    "ignition.region=0",
    "observation=satellite",
    "observation.radius=-1",
    "reward=money",
    "reward.gamma=2",
    "reward.shaping=-1",
    "reward.team_share=.nan",
    "model=transformer",
    "model.sharing=some",
    "model.actor_hidden=[0]",
    "model.actor_hidden=32",
    "algorithm.learning_rate=2",
    "algorithm.learning_rate=.nan",
    "algorithm.max_grad_norm=0",
    "algorithm.minibatch_size=0",
    "algorithm.lmbda=1.1",
    "algorithm=dqn algorithm.warm_up=60000",
    "algorithm=dqn algorithm.capacity=10",
    "algorithm=dqn algorithm.epsilon_end=2",
    "algorithm=sac algorithm.tau=0",
    "collector=threads",
    "collector=process collector.workers=3",
    "collector.steps=100001",
    "logger=mail",
    "logger=wandb logger.mode=loud",
    "checkpoint.interval=0",
    "checkpoint.keep=0",
    "checkpoint=null",
    "checkpoint.every=3",
    "evaluation.episodes=0",
    "evaluation.first_seed=-1",
    "evaluation.interval=-1",
    "evaluation.mode=null",
    "scenario=landfire",
    "scenario=null",
    "experiment=paper",
    "hydra.run.dir=here sede=1",
    "-m seed=0,1 n_worlds=0",
    "resume=/no/such/run",
    "resume=. seed=3",
    "resume=. ++total_frames=3",
    "policy=greedy",
    "fire._target_=builtins.eval",
    "reward._target_=warp_torchrl.world.law.fire.Fire2",
]

VALID = [
    "",
    "seed=243",
    "seed=2147483648",
    "n_worlds=4096",
    "total_frames=1",
    "horizon=1",
    "cell_size=10",
    "landscape.size=[8,24]",
    "landscape.scale=[5,10]",
    "landscape.thresholds=minmax",
    "wind=calm",
    "wind=wandering wind.speed=0",
    "wind=paper",
    "fire=paper",
    "fire=hazard fire.kernel=ellipse",
    "fire.neighbours=4",
    "team.n_agents=4 team.roles=[ugv,uav]",
    "team.tank=0",
    "ignition.count=3",
    "observation=local observation.radius=1",
    "observation=paper",
    "reward=paper",
    "reward=adaptive reward.normalise=true",
    "model=cnn",
    "model.sharing=none",
    "algorithm=dqn algorithm.target_interval=100",
    "algorithm=maddpg",
    "collector=process collector.workers=4",
    "logger=wandb",
    "checkpoint.interval=1 checkpoint.keep=2",
    "-m seed=0,1 algorithm=ppo,a2c",
    "experiment=paper_marl",
    "scenario=giant",
]


def test_a_hundred_mistakes_are_refused_and_leave_nothing(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    wrong = []
    for line in INVALID:
        monkeypatch.setattr("sys.argv", ["train.py", *line.split()])
        with pytest.raises(SystemExit) as end:
            train()
        errors = capfd.readouterr().err.strip().splitlines()
        expected = 4 if line.startswith("resume=/") else 2
        if (
            end.value.code != expected
            or len(errors) != 1
            or not errors[0].startswith("error: ")
            or list(tmp_path.iterdir())
        ):
            wrong.append((line, end.value.code, errors[-3:]))
    with capfd.disabled():
        print(f"\ninvalid configurations refused / tried: {len(INVALID) - len(wrong)} / {len(INVALID)}")
    assert not wrong and len(INVALID) >= 100


def test_thirty_configurations_are_accepted(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("warp_torchrl.commands.command._train_job", lambda config: None)
    for line in VALID:
        monkeypatch.setattr("sys.argv", ["train.py", *line.split()])
        with pytest.raises(SystemExit) as end:
            train()
        assert end.value.code == 0, line
    with capfd.disabled():
        print(f"\nvalid configurations accepted / tried: {len(VALID)} / {len(VALID)}")
    assert len(VALID) >= 30
