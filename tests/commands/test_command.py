"""The two commands, as a user runs them, on a tiny setting."""

import json
import os
import shutil
import signal
import subprocess
import sys
from contextlib import nullcontext, redirect_stdout
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch
from hydra._internal.hydra import Hydra
from hydra.core.plugins import Plugins

from tests.forgery import forge
from warp_torchrl import load_policy, make_env
from warp_torchrl.commands import command as command_module
from warp_torchrl.commands.command import evaluate, train
from warp_torchrl.commands.queue import Queue
from warp_torchrl.commands.sweep import SweepSummary
from warp_torchrl.evaluation import checks as checks_module
from warp_torchrl.runs import checkpoint
from warp_torchrl.runs.config import building
from warp_torchrl.runs.export import export
from warp_torchrl.system.lock import RunFolderLock
from warp_torchrl.system.signals import Stopped
from warp_torchrl.training import run as run_module
from warp_torchrl.training.loop import Training
from warp_torchrl.world.world import World

ROOT = Path(__file__).parents[2]
TINY = [
    "landscape.size=12",
    "horizon=16",
    "n_worlds=4",
    "collector.steps=8",
    "collector.grows_at=0",
    "total_frames=128",
    "checkpoint.interval=32",
    "checkpoint.minutes=0",
    "evaluation.episodes=6",
    "algorithm.minibatch_size=16",
    "model.actor_hidden=[16]",
    "model.critic_hidden=[16]",
]

DRAWN = ("test_a_sweep_of_evaluations_ends_in_one_table_and_one_figure",)
"""Tests of the figures."""


def command(program, *arguments, folder):
    """Run a command in a folder of its own and return it when it has ended."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "COLUMNS": "200"}
    return subprocess.run(
        [sys.executable, str(ROOT / program), *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )


@pytest.fixture(autouse=True)
def _figures(request):
    if request.function.__name__ not in DRAWN and find_spec("matplotlib") is not None:
        request.getfixturevalue("blank_figures")


@pytest.fixture
def run_here(tmp_path, monkeypatch, capfd):
    """Run a command in this process, in a folder of its own; returns its exit code, stderr's lines and stdout."""
    monkeypatch.chdir(tmp_path)
    look = Hydra.get_mode

    def get_mode(hydra, config_name, overrides):
        """Compose to look for ``hydra.mode`` only where it may be set: that is half of a short command's time."""
        may_be_set = any(each.startswith(("hydra.mode", "experiment")) for each in overrides)
        return look(hydra, config_name, overrides) if may_be_set else None

    monkeypatch.setattr(Hydra, "get_mode", get_mode)
    monkeypatch.setattr(SweepSummary, "exit_code", 0)  # of a sweep before in this process

    def run(program, *arguments):
        monkeypatch.setattr(sys, "argv", [program, *arguments])
        with pytest.raises(SystemExit) as end:
            {"train.py": train, "evaluate.py": evaluate}[program]()
        said, errors = capfd.readouterr()
        return end.value.code, errors.strip().splitlines(), said

    return run


def signalled(function, number, when=1):
    """The function, whose process is sent a signal when it is called for the so many'th time."""
    calls = []

    def wrapped(*args, **options):
        calls.append(1)
        if len(calls) == when:
            os.kill(os.getpid(), number)
        return function(*args, **options)

    return wrapped


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """The folder of a run, and what the command has printed."""
    folder = tmp_path_factory.mktemp("trained")
    with pytest.MonkeyPatch.context() as patched, redirect_stdout(StringIO()) as said:
        patched.chdir(folder)
        patched.setattr(sys, "argv", ["train.py", *TINY, "hydra.run.dir=run"])
        if find_spec("matplotlib") is not None:
            patched.setattr("matplotlib.figure.Figure.savefig", lambda figure, file, **options: Path(file).touch())
        with pytest.raises(SystemExit) as end:
            train()
    assert end.value.code == 0
    return folder / "run", said.getvalue()


def test_train_leaves_everything_that_the_contract_names(trained):
    run, said = trained
    for name in ("config.yaml", "metrics.csv", "train.log", "evaluation.json", "episode.gif"):
        assert (run / name).stat().st_size > 0, name
    assert len((run / "metrics.csv").read_text().splitlines()) == 5
    assert "coordinated" in said and "trained" in said
    content = json.loads((run / "evaluation.json").read_text())
    assert content["seeds"] == list(range(1_000_000, 1_000_006))
    assert set(content["versus"]) == {"noop", "random", "local", "greedy", "coordinated"}


@pytest.mark.parametrize("program", ["train.py", "resume", "evaluate.py"])
def test_what_a_command_runs_is_built_once(program, trained, run_here, tmp_path, monkeypatch):
    shutil.copytree(trained[0], tmp_path / "before")
    built, make, begin = [], building.run_config, World.__post_init__

    def end(*given):
        raise RuntimeError("enough")

    monkeypatch.setattr(building, "run_config", lambda values: built.append("run") or make(values))
    monkeypatch.setattr(World, "__post_init__", lambda world: built.append("world") or begin(world))
    monkeypatch.setattr(Training, "train", end)
    for module in (run_module, command_module):
        monkeypatch.setattr(module, "evaluate_policy", end)
    given = {"train.py": TINY, "resume": ["resume=before", "total_frames=256"], "evaluate.py": ["checkpoint=before"]}
    _, errors, _ = run_here(program if program.endswith(".py") else "train.py", *given[program])
    assert "enough" in errors[-1] and built == ["run", "world"]


def test_evaluate_repeats_what_training_found(trained, run_here, tmp_path):
    run, _ = trained
    code, errors, _ = run_here("evaluate.py", f"checkpoint={run}", "hydra.run.dir=seen")
    assert code == 0, errors
    ours, theirs = (json.loads((where / "evaluation.json").read_text()) for where in (tmp_path / "seen", run))
    assert ours["episodes"] == theirs["episodes"] and ours["versus"] == theirs["versus"]
    assert (tmp_path / "seen" / "episode.gif").exists()


def test_evaluate_takes_another_scenario_for_the_same_policy_and_a_policy_of_null_is_none(trained, run_here):
    few = ("evaluation.episodes=2", "evaluation.baselines=[noop]", "horizon=8", "picture=null")
    code, errors, said = run_here("evaluate.py", f"checkpoint={trained[0]}", "policy=null", "scenario=single", *few)
    assert code == 0, errors
    assert "single horizon=8: 2 fires" in said and "trained" in said


def contents(folder):
    return {path.relative_to(folder): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


NOOP = ("policy=noop", "landscape.size=12", "horizon=4", "evaluation.episodes=2", "evaluation.baselines=[]")
BLIND = (*NOOP, "picture=null")
"""To draw the first fire is half of such an evaluation."""


def test_an_evaluation_never_writes_into_a_run_unless_told_to(trained, run_here, tmp_path):
    shutil.copytree(trained[0], tmp_path / "run")
    before = contents(tmp_path / "run")
    code, errors, _ = run_here("evaluate.py", *NOOP, "hydra.run.dir=run")
    assert code == 2 and len(errors) == 1
    assert "hydra.run.dir: run holds a run: checkpoints, config.yaml, episode.gif and 2 more; take another" in errors[0]
    assert "overwrite=true" in errors[0] and contents(tmp_path / "run") == before
    code, errors, _ = run_here("evaluate.py", *NOOP, "hydra.run.dir=run", "overwrite=true")
    assert code == 0, errors
    after = contents(tmp_path / "run")
    replaced = {str(path) for path, content in after.items() if before.get(path) != content}
    assert replaced == {"evaluation.json", "episode.gif", "evaluate.log"}


@pytest.mark.parametrize("what", ["policy=greedy", "checkpoint={run}"])
def test_an_evaluation_draws_maps_of_one_ground(trained, run_here, tmp_path, what):
    pytest.importorskip("rasterio", reason="maps need the extra gis")
    pytest.importorskip("matplotlib", reason="maps need the extra figures")
    few = ("maps_fires=4", "evaluation.episodes=2", "evaluation.baselines=[noop]", "horizon=8", "landscape.size=12")
    what = what.format(run=trained[0])
    code, errors, said = run_here("evaluate.py", what, *few, "maps=true", "hydra.run.dir=seen")
    assert code == 0, errors
    assert "maps: 4 fires on the ground of seed 1000000" in said
    kinds = ("difference", "with", "without")
    written = {path.name for path in (tmp_path / "seen").iterdir()} - {"evaluate.log"}
    assert written == {
        "evaluation.json", "episode.gif", "maps.png", *(f"burn_probability_{kind}.tif" for kind in kinds),
    }  # fmt: skip
    numbers = json.loads((tmp_path / "seen" / "evaluation.json").read_text())["maps"]
    assert numbers["fires"] == 4 and set(numbers["burned_ha"]["difference"]) >= {"mean", "ci95"}


@pytest.mark.parametrize(("kind", "module"), [("gif", None), ("html", "viser"), ("mp4", "av"), ("null", None)])
def test_an_evaluation_writes_its_first_fire_as_it_is_told(run_here, tmp_path, kind, module):
    if module is not None:
        pytest.importorskip(module, reason="needs the extra live or video")
    code, errors, _ = run_here("evaluate.py", *NOOP, f"picture={kind}", "hydra.run.dir=seen")
    assert code == 0, errors
    written = {path.name for path in (tmp_path / "seen").iterdir()} - {"evaluate.log"}
    assert written == {"evaluation.json"} | ({f"episode.{kind}"} if kind != "null" else set())
    if kind == "html":
        assert "<h1>skirmish</h1><p>noop</p>" in (tmp_path / "seen" / "episode.html").read_text()


@pytest.mark.parametrize(
    ("what", "kind", "said"),
    [
        (NOOP, "htlm", "picture must be gif or html or mp4 or null, got 'htlm': did you mean html?"),
        (NOOP, "true", "picture must be gif or html or mp4 or null, got True"),
        (NOOP, "mp4", 'picture=mp4 needs av, not installed: pip install "warp_torchrl[video]"'),
        (("checkpoint=skirmish",), "html", 'picture=html needs viser, not installed: pip install "warp_torchrl[live]"'),
    ],
)
def test_a_picture_that_cannot_be_written_is_told_before_anything_is_played(
    run_here, tmp_path, monkeypatch, what, kind, said
):
    monkeypatch.setattr(checks_module, "find_spec", lambda name: None)
    monkeypatch.setattr("warp_torchrl.evaluation.evaluate.play", None)
    code, errors, _ = run_here("evaluate.py", *what, f"picture={kind}", "hydra.run.dir=seen")
    assert code == 2 and said in errors[-1]
    assert not (tmp_path / "seen").exists()


def test_maps_say_which_extras_they_need(run_here, tmp_path, monkeypatch):
    monkeypatch.setattr(checks_module, "find_spec", lambda name: None if name == "rasterio" else name)
    code, errors, _ = run_here("evaluate.py", *NOOP, "maps=true", "hydra.run.dir=seen")
    assert code == 2 and 'maps needs rasterio, not installed: pip install "warp_torchrl[figures,gis]"' in errors[-1]
    assert not (tmp_path / "seen").exists()


def test_an_evaluation_never_writes_over_another_nor_a_sweep_over_a_sweep(run_here, tmp_path):
    (tmp_path / "sweep" / "0").mkdir(parents=True)
    (tmp_path / "seen").mkdir()
    for folder in (tmp_path / "seen", tmp_path / "sweep" / "0"):
        (folder / "evaluation.json").write_text("{}")
    before = contents(tmp_path)
    for where, flags, held in (("hydra.run.dir=seen", (), "an evaluation: "), ("hydra.sweep.dir=sweep", ("-m",), "0")):
        code, errors, _ = run_here("evaluate.py", *flags, *BLIND, where)
        assert code == 2 and len(errors) == 1 and f"{where.replace('=', ': ')} holds {held}" in errors[0]
        assert contents(tmp_path) == before


def test_two_jobs_of_a_sweep_of_evaluations_do_not_share_a_folder(run_here, tmp_path):
    what = (*BLIND, "scenario=skirmish,single", "hydra.sweep.dir=sweep", "hydra.sweep.subdir=one")
    code, errors, _ = run_here("evaluate.py", "-m", *what)
    assert code == 2 and "one holds an evaluation" in errors[-1]
    assert json.loads((tmp_path / "sweep" / "one" / "evaluation.json").read_text())["scenario"] == "skirmish"


@pytest.mark.parametrize("sweeps", [(), pytest.param(("-m",), marks=pytest.mark.slow)], ids=["once", "sweep"])
def test_what_a_scenario_says_of_an_option_goes_with_the_option(run_here, tmp_path, sweeps):
    wind = ["scenario=hazard", "wind=calm", "landscape.size=12", "horizon=4"]  # the scenario's own wind has a speed
    few = ("evaluation.episodes=1", "evaluation.baselines=[]", "picture=null")
    code, errors, _ = run_here("evaluate.py", *sweeps, "policy=noop", *few, *wind)
    assert code == 0, errors


def test_a_sweep_that_is_repeated_forgets_the_jobs_that_failed(run_here, tmp_path):
    (tmp_path / "sweep" / "0").mkdir(parents=True)
    failed = {"job": 0, "overrides": "", "code": 6, "reason": "the disk was full"}
    (tmp_path / "sweep" / "0" / "failed.json").write_text(json.dumps(failed))
    (tmp_path / "sweep" / "0" / "evaluation.json").write_text("{}")
    code, errors, _ = run_here("evaluate.py", "-m", *BLIND, "hydra.sweep.dir=sweep", "overwrite=true")
    assert code == 0, errors
    assert not (tmp_path / "sweep" / "0" / "failed.json").exists()
    assert json.loads((tmp_path / "sweep" / "0" / "evaluation.json").read_text())["scenario"] == "skirmish"


def test_training_does_not_replace_an_evaluation(run_here, tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "evaluation.json").write_text("{}")
    code, errors, _ = run_here("train.py", *TINY, "hydra.run.dir=run")
    assert code == 2 and "run holds an evaluation" in errors[-1]
    assert (tmp_path / "run" / "evaluation.json").read_text() == "{}"


@pytest.mark.parametrize(
    ("wrong", "expected", "message"),
    [
        ("observation.radius=4", 2, "this environment shows [11, 9, 9]"),
        ("evaluation.episodes=0", 2, "evaluation.episodes must be"),
        pytest.param("evaluation.first_seed=-1", 2, "evaluation.first_seed must be", marks=pytest.mark.slow),
        pytest.param("device=cuda:99", 2, "device must be one of", marks=pytest.mark.slow),
        ("landscape=raster", 2, "landscape.path must name"),
        pytest.param("team.n_agents=70", 2, "team.n_agents must be", marks=pytest.mark.slow),
        ("overwrite=maybe", 2, "overwrite must be true or false"),
        ("maps=maybe", 2, "maps must be true or false"),
        ("maps_fires=1", 2, "maps_fires must be a whole number in 2..1000000, got 1"),
        pytest.param("maps_fires=2.5", 2, "maps_fires must be a whole number", marks=pytest.mark.slow),
        ("maps_fires=20", 2, "maps_fires must come with maps=true, got 20 alone"),
        ("other weights", 4, "is of another architecture"),
        ("cut", 4, "policy.pt is missing or was cut"),
    ],
)
def test_a_mistake_in_an_evaluation_leaves_no_folder(trained, run_here, tmp_path, wrong, expected, message):
    shutil.copytree(trained[0] / "checkpoints" / "128", tmp_path / "checkpoints" / "128")
    policy = tmp_path / "checkpoints" / "128" / "policy.pt"
    if wrong == "other weights":
        weights = torch.load(policy, weights_only=True)
        torch.save(dict(list(weights.items())[1:]), policy)
        forge(policy.parent)
    elif wrong == "cut":
        policy.write_bytes(policy.read_bytes()[:-1])
    overrides = [wrong] if "=" in wrong else []
    code, errors, _ = run_here("evaluate.py", "checkpoint=checkpoints/128", *overrides, "hydra.run.dir=seen")
    assert code == expected and len(errors) == 1 and message in errors[0], errors
    assert [each.name for each in tmp_path.iterdir()] == ["checkpoints"]


def test_evaluate_takes_a_policy_that_ships_by_its_name(tmp_path, run_here):
    few = ("landscape.size=16", "horizon=12", "evaluation.episodes=2", "evaluation.baselines=[noop]", "picture=null")
    what = ("checkpoint=skirmish", *few, "hydra.run.dir=seen")
    code, errors, _ = run_here("evaluate.py", *what)
    assert code == 0, errors
    assert json.loads((tmp_path / "seen" / "evaluation.json").read_text())["scenario"] == "skirmish"


def test_evaluate_takes_a_policy_by_name(tmp_path, run_here):
    (tmp_path / "seen").mkdir()
    (tmp_path / "seen" / "evaluate.log").write_text("an earlier mistake\n")
    arguments = ("policy=local", "landscape.size=12", "horizon=12", "evaluation.episodes=4", "picture=null")
    code, errors, _ = run_here("evaluate.py", *arguments, "hydra.run.dir=seen")
    assert code == 0, errors
    content = json.loads((tmp_path / "seen" / "evaluation.json").read_text())
    assert content["policy"] == "local" and "local" not in content["versus"]


def test_a_finished_run_resumes_to_nothing_and_exits_0(trained, run_here):
    run, _ = trained
    before = (run / "metrics.csv").read_bytes()
    code, errors, _ = run_here("train.py", f"resume={run}")
    assert code == 0, errors
    assert (run / "metrics.csv").read_bytes() == before


def weights_and_numbers(run):
    """What a run has learnt, and its rows but for the times."""
    rows = [row.split(",")[3:] for row in (run / "metrics.csv").read_text().splitlines()]
    return checkpoint.newest(run)[0].policy(), rows


CONSTANT = ("algorithm.learning_rate_end=1.0", "algorithm.entropy_coeff_end=0.005")


@pytest.mark.slow
def test_a_finished_run_is_trained_longer_and_goes_on_to_the_new_total(run_here, tmp_path, monkeypatch):
    """Killed on the way and in the evaluation; where nothing changes over a training it equals one that never ended."""
    own = (*SHORT[:-1], *CONSTANT)
    for total, name in ((64, "run"), (128, "whole")):
        code, errors, _ = run_here("train.py", *own, f"total_frames={total}", f"hydra.run.dir={name}")
        assert code == 0, errors
    run, first = tmp_path / "run", (tmp_path / "run" / "evaluation.json").read_bytes()
    with monkeypatch.context() as patched:
        patched.setattr(Training, "_learn", signalled(Training._learn, signal.SIGTERM))
        code, *_ = run_here("train.py", "resume=run", "total_frames=128")
    assert code == 128 + signal.SIGTERM and checkpoint.newest(run)[0].manifest.frames == 96
    assert "total_frames was 64 and is 128: " in (run / "train.log").read_text()
    with monkeypatch.context() as patched:
        patched.setattr(run_module, "evaluate_policy", signalled(run_module.evaluate_policy, signal.SIGTERM))
        code, *_ = run_here("train.py", "resume=run")
    assert code == 128 + signal.SIGTERM and checkpoint.newest(run)[0].manifest.frames == 128
    assert (run / "evaluation.json").read_bytes() == first, "it is replaced by the next one alone"
    code, errors, _ = run_here("train.py", "resume=run")
    assert code == 0, errors
    ours, theirs = weights_and_numbers(run), weights_and_numbers(tmp_path / "whole")
    assert ours[1] == theirs[1] and len(ours[1]) == 5
    assert all(torch.equal(ours[0][name], value) for name, value in theirs[0].items())
    ours, theirs = (json.loads((tmp_path / name / "evaluation.json").read_text()) for name in ("run", "whole"))
    assert ours["episodes"] == theirs["episodes"] and ours["frames"] == 128
    before = contents(run)
    assert run_here("train.py", "resume=run")[0] == 0
    assert {name for name, content in contents(run).items() if before[name] != content} == {Path("train.log")}


@pytest.mark.stress
def test_a_run_that_was_stopped_goes_on_to_a_new_total_even_if_killed_at_once(run_here, tmp_path, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(Training, "_learn", signalled(Training._learn, signal.SIGTERM))
        run_here("train.py", *SHORT)
    with monkeypatch.context() as patched:
        patched.setattr(Training, "train", lambda training, signals: None)  # dies before it saves anything
        patched.setattr(run_module, "evaluate_policy", lambda *args: sys.exit(9))
        assert run_here("train.py", "resume=run", "total_frames=96")[0] == 9
    code, errors, _ = run_here("train.py", "resume=run")
    assert code == 0, errors
    found = checkpoint.newest(tmp_path / "run")[0]
    assert found.manifest.frames == 96 and found.saved_config().values["total_frames"] == 96


@pytest.mark.parametrize("total", [128, 100, 0, "many"])
def test_a_total_that_was_reached_is_refused_in_one_line(trained, run_here, tmp_path, total):
    shutil.copytree(trained[0], tmp_path / "run")
    before = contents(tmp_path / "run")
    code, errors, _ = run_here("train.py", "resume=run", f"total_frames={total}")
    assert code == 2 and len(errors) == 1 and "total_frames must be " in errors[0]
    assert contents(tmp_path / "run") == before
    assert total not in (128, 100) or f"more than the 128 that run has had, got {total}" in errors[0]


def test_an_edited_configuration_is_told_and_not_ignored(trained, run_here, tmp_path, monkeypatch):
    shutil.copytree(trained[0], tmp_path / "run")
    path = tmp_path / "run" / "config.yaml"
    text = path.read_text()
    path.write_text(text.replace("gamma: 0.99", "gamma: 0.9"))
    before = contents(tmp_path / "run")
    code, errors, _ = run_here("train.py", "resume=run")
    assert code == 2 and len(errors) == 1 and contents(tmp_path / "run") == before
    assert (
        "run/config.yaml is not what the checkpoint was trained with: algorithm.gamma is 0.9 and was 0.99, "
        in errors[0]
    )
    assert "start_from=run" in errors[0]
    path.write_text("# what was best\n\n" + text.replace("gamma: 0.99", "gamma:   99.0e-2  # as ever"))
    code, errors, _ = run_here("train.py", "resume=run")
    assert code == 0, errors
    path.write_text(text.replace("total_frames: 128", "total_frames: 160"))
    monkeypatch.setattr(run_module, "evaluate_policy", lambda *given: SimpleNamespace(folder=None))
    code, errors, _ = run_here("train.py", "resume=run")
    assert code == 0, errors
    assert checkpoint.newest(tmp_path / "run")[0].manifest.frames == 160, "the total may change"


def test_a_run_folder_is_not_trained_into_twice(trained, run_here):
    run, _ = trained
    before = (run / "metrics.csv").read_bytes()
    code, errors, _ = run_here("train.py", *TINY, f"hydra.run.dir={run}")
    assert code == 2 and "holds a run already" in errors[-1]
    assert (run / "metrics.csv").read_bytes() == before


def test_a_run_stopped_by_a_signal_resumes_to_what_it_would_have_been(trained, run_here, tmp_path, monkeypatch):
    """SIGTERM in mid-run exits with 143; the resumed run's numbers equal those of the run never stopped."""
    run, _ = trained
    cut = tmp_path / "cut"
    with monkeypatch.context() as patched:
        patched.setattr(Training, "_learn", signalled(Training._learn, signal.SIGTERM, 2))
        code, errors, _ = run_here("train.py", *TINY, "checkpoint.interval=1000000", "hydra.run.dir=cut")
    assert code == 128 + signal.SIGTERM and errors[-1].endswith(f"; go on with resume={cut}")
    assert len((cut / "metrics.csv").read_text().splitlines()) == 3
    code, errors, _ = run_here("train.py", f"resume={cut}")
    assert code == 0, errors
    ours, theirs = (
        [row.split(",")[3:] for row in (folder / "metrics.csv").read_text().splitlines()] for folder in (cut, run)
    )
    assert ours == theirs
    ours, theirs = (json.loads((folder / "evaluation.json").read_text()) for folder in (cut, run))
    assert ours["episodes"] == theirs["episodes"]


SHORT = [
    *TINY,
    "total_frames=64",
    "evaluation.episodes=2",
    "evaluation.baselines=[noop]",
    "evaluation.mode=sampled",
    "hydra.run.dir=run",
]


def test_the_same_command_line_goes_on_with_a_run_that_a_queue_has_stopped(run_here, tmp_path, monkeypatch):
    frames = lambda: checkpoint.newest(tmp_path / "run")[0].manifest.frames  # noqa: E731
    with monkeypatch.context() as patched:
        patched.setattr(Training, "_learn", signalled(Training._learn, signal.SIGUSR2))
        assert run_here("train.py", *SHORT)[0] == 128 + signal.SIGUSR2
    assert frames() == 32
    for other in ("algorithm.gamma=0.9", "total_frames=96"):
        code, errors, _ = run_here("train.py", *SHORT, other)
        assert code == 2 and "holds a run already; go on with resume=" in errors[-1] and frames() == 32
    assert run_here("train.py", *SHORT, "debug=true")[0] == 0 and frames() == 64
    assert len((tmp_path / "run" / "metrics.csv").read_text().splitlines()) == 3
    assert run_here("train.py", *SHORT)[0] == 2, "it has come to its end"


def test_a_run_that_was_stopped_before_it_saved_begins_anew(run_here, tmp_path, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(Training, "train", lambda training, signals: os.kill(os.getpid(), signal.SIGTERM))
        assert run_here("train.py", *SHORT)[0] == 143
        patched.setattr(Training, "train", lambda training, signals: sys.exit(9))
        assert run_here("train.py", *SHORT)[0] == 9


def test_a_sweep_that_is_started_again_leaves_what_has_come_to_its_end(trained, run_here, tmp_path):
    shutil.copytree(trained[0], tmp_path / "sweep" / "0")
    before = contents(tmp_path / "sweep" / "0")
    assert run_here("train.py", "-m", *TINY, "hydra.sweep.dir=sweep")[0] == 0
    now = contents(tmp_path / "sweep" / "0")
    assert {name for name in now if before[name] != now[name]} == {Path("train.log")}
    code, errors, _ = run_here("train.py", "-m", *TINY, "seed=1", "hydra.sweep.dir=sweep")
    assert code == 2 and "holds a run already" in errors[-1]


@pytest.mark.parametrize(
    ("owner", "name", "when", "number", "frames"),
    [
        pytest.param(checkpoint.disk, "save_tensors", 1, signal.SIGTERM, [32], marks=pytest.mark.stress),
        pytest.param(checkpoint, "_drop", 2, signal.SIGUSR1, [32, 64], marks=pytest.mark.stress),
        pytest.param(Training, "_learn", 2, signal.SIGINT, [32, 64], marks=pytest.mark.stress),
        (run_module, "evaluate_policy", 1, signal.SIGINT, [32, 64]),
    ],
    ids=["in a save", "in the last save", "in the last iteration", "in the evaluation"],
)
def test_a_signal_anywhere_leaves_sound_checkpoints_and_the_way_on(
    tmp_path, run_here, monkeypatch, owner, name, when, number, frames
):
    with monkeypatch.context() as patched:
        patched.setattr(owner, name, signalled(getattr(owner, name), number, when))
        code, errors, _ = run_here("train.py", *SHORT)
    assert code == 128 + number and f"stopped by signal {number.name}" in errors[-1]
    assert sorted(int(each.name) for each in (tmp_path / "run" / "checkpoints").iterdir()) == frames
    assert checkpoint.newest(tmp_path / "run")[1] == []
    code, errors, _ = run_here("train.py", "resume=run")
    assert code == 0, errors
    assert (tmp_path / "run" / "evaluation.json").exists()


@pytest.mark.parametrize(
    ("number", "jobs"),
    [(signal.SIGTERM, ["0"]), pytest.param(signal.SIGUSR2, ["0", "1"], marks=pytest.mark.stress)],
)
def test_a_signal_ends_a_sweep_and_a_queue_s_warning_its_job(tmp_path, run_here, monkeypatch, number, jobs):
    def stopped(config, options, folder, **more):
        raise Stopped(number, folder)

    def refuse(number, frame):
        raise RuntimeError("timed-out too many times")

    queue = Queue(signal.SIGUSR2, refuse)
    monkeypatch.setattr(command_module, "train_composed", stopped)
    monkeypatch.setattr(command_module, "queued", lambda: nullcontext(queue))
    code, *_ = run_here("train.py", *SHORT[:-1], "-m", "seed=0,1", "hydra.sweep.dir=sweep")
    assert code == 128 + number
    assert [each.name for each in sorted((tmp_path / "sweep").iterdir()) if each.is_dir()] == jobs


@pytest.mark.parametrize("more", [pytest.param([], marks=pytest.mark.slow), ["overwrite=true"]])
def test_a_second_evaluation_in_a_folder_is_refused(tmp_path, run_here, more):
    lock = RunFolderLock(tmp_path / "seen")
    code, errors, _ = run_here("evaluate.py", *BLIND, "hydra.run.dir=seen", *more)
    lock.release()
    assert code == 3 and "seen is in use" in errors[-1] and not (tmp_path / "seen" / "evaluation.json").exists()
    (tmp_path / "seen" / ".lock").unlink()
    code, *_ = run_here("evaluate.py", *BLIND, "hydra.run.dir=seen", *more)
    assert code == 0
    assert not (tmp_path / "seen" / ".lock").exists() and (tmp_path / "seen" / "evaluation.json").exists()


def test_a_second_run_in_a_folder_is_refused_and_the_first_goes_on(tmp_path, run_here):
    lock = RunFolderLock(tmp_path / "run")
    code, errors, _ = run_here("train.py", *SHORT)
    lock.release()
    assert code == 3 and "in use" in errors[-1]
    assert not (tmp_path / "run" / "metrics.csv").exists() and not (tmp_path / "run" / "config.yaml").exists()


def test_a_run_that_died_before_its_first_checkpoint_may_start_again(tmp_path, run_here, monkeypatch):
    (tmp_path / "run" / "checkpoints" / ".32.tmp").mkdir(parents=True)
    (tmp_path / "run" / "config.yaml").write_text("old: 1")
    monkeypatch.setattr(run_module, "evaluate_policy", lambda *given: SimpleNamespace(folder=None))
    code, errors, _ = run_here("train.py", *SHORT)
    assert code == 0, errors
    assert "old: 1" not in (tmp_path / "run" / "config.yaml").read_text()


def test_a_checkpoint_is_no_run_folder_to_resume(trained, run_here):
    path = checkpoint.newest(trained[0])[0].path
    code, (line,), _ = run_here("train.py", f"resume={path}")
    assert code == 2 and "resume must be a run folder" in line
    assert sorted(each.name for each in path.iterdir()) == ["config.json", "manifest.json", "policy.pt", "training.pt"]


def test_a_run_starts_from_another_ones_networks_on_another_scenario(trained, run_here, tmp_path):
    run, _ = trained
    arguments = [each for each in SHORT if "landscape" not in each]
    code, errors, _ = run_here("train.py", *arguments, "scenario=shift", "landscape.size=14", f"start_from={run}")
    assert code == 0, errors
    shutil.move(tmp_path / "run", tmp_path / "moved")
    few = ("evaluation.episodes=1", "evaluation.baselines=[]", "picture=null")
    code, errors, _ = run_here("evaluate.py", "checkpoint=moved", *few, "hydra.run.dir=seen")
    assert code == 0, errors  # where it started from is recorded, and no longer needed


@pytest.mark.parametrize(
    ("path", "said", "expected"),
    [
        ("nowhere", "nowhere is not a run folder", 4),
        ("alone algorithm=dqn", "holds a policy alone", 4),
        ("alone algorithm=ippo model.actor_hidden=[8]", "was trained by another algorithm or other networks", 4),
        ("run model.symmetry=none", "was trained by another algorithm or other networks", 4),
    ],
)
def test_a_start_that_is_none_is_refused_before_anything_is_written(trained, run_here, tmp_path, path, said, expected):
    export(checkpoint.newest(trained[0])[0], tmp_path / "alone")
    path, *others = path.replace("run ", f"{trained[0]} ").split()
    code, errors, _ = run_here("train.py", *SHORT, f"start_from={path}", *others)
    assert code == expected and said in errors[-1] and len(errors) == 1
    assert not (tmp_path / "run").exists()


def test_a_policy_alone_is_evaluated_as_its_run_was(trained, run_here, tmp_path):
    export(checkpoint.newest(trained[0])[0], tmp_path / "alone")
    code, errors, _ = run_here("evaluate.py", "checkpoint=alone", "picture=null", "hydra.run.dir=seen")
    assert code == 0, errors
    ours, theirs = (json.loads((each / "evaluation.json").read_text()) for each in (tmp_path / "seen", trained[0]))
    assert ours["episodes"] == theirs["episodes"]


def test_an_unsound_checkpoint_is_told_and_the_one_before_taken(trained, run_here, tmp_path):
    shutil.copytree(trained[0], tmp_path / "run")
    newest, *_ = sorted((tmp_path / "run" / "checkpoints").iterdir(), key=lambda each: -int(each.name))
    (newest / "policy.pt").write_bytes(b"")
    code, errors, _ = run_here("train.py", "resume=run")
    assert code == 0, errors
    skipped = [line for line in (tmp_path / "run" / "train.log").read_text().splitlines() if "skipped: " in line]
    assert len(skipped) == 1 and "policy.pt is missing or was cut" in skipped[0]
    ours, theirs = (json.loads((each / "evaluation.json").read_text()) for each in (tmp_path / "run", trained[0]))
    assert ours["episodes"] == theirs["episodes"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_disk_ends_with_its_path_and_reason(tmp_path, run_here):
    (tmp_path / "run").mkdir()
    for name in ("metrics.csv", "train.log"):
        (tmp_path / "run" / name).symlink_to("/dev/full")
    code, errors, _ = run_here("train.py", *SHORT)
    assert code == 6 and errors[-1] == f"error: {tmp_path / 'run' / 'metrics.csv'}: No space left on device"
    assert "Traceback" not in "".join(errors)


@pytest.mark.parametrize("program", ["train.py", "evaluate.py"])
def test_a_run_folder_that_cannot_be_made_is_told_with_its_path(tmp_path, run_here, program):
    (tmp_path / "file").touch()
    what = SHORT[:-1] if program == "train.py" else ["policy=noop", "evaluation.episodes=1"]
    code, errors, _ = run_here(program, *what, "hydra.run.dir=file/run")
    assert code == 6 and "file/run: Not a directory" in errors[-1]
    assert "Traceback" not in "".join(errors)


def test_a_loaded_policy_plays(trained):
    env = make_env("skirmish", n_worlds=2, overrides=["landscape.size=12"])
    rollout = env.rollout(4, load_policy(trained[0]), break_when_any_done=False)
    assert rollout["agents", "action"].shape == (2, 4, 2)


@pytest.mark.slow
def test_the_experiment_of_all_algorithms_is_a_sweep(tmp_path, run_here):
    arguments = (
        *("--config-dir", str(ROOT / "docs"), "experiment=algorithms"),
        *TINY,
        "total_frames=32",
        "horizon=8",
        "evaluation.episodes=2",
        "evaluation.mode=sampled",
        "algorithm=a2c,vdn",
        "seed=4",
    )
    code, errors, _ = run_here("train.py", *arguments, "hydra.sweep.dir=sweep")
    assert code == 0, errors
    assert "a2c" in (tmp_path / "sweep" / "summary.md").read_text() and (tmp_path / "sweep" / "1").is_dir()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("program", "launcher"), [("evaluate.py", "joblib"), ("train.py", "joblib"), ("train.py", "submitit")]
)
def test_jobs_in_processes_of_their_own_end_in_one_folder_and_the_one_that_failed_is_named(tmp_path, program, launcher):
    pytest.importorskip(f"hydra_plugins.hydra_{launcher}_launcher")
    option = {"joblib": "joblib", "submitit": "submitit_local"}[launcher]
    what = ["policy=noop", "landscape.size=12"] if program == "evaluate.py" else [*TINY, "total_frames=32"]
    what += ["horizon=8", "evaluation.episodes=2"]
    levels = "landscape.levels=[0,0,0.5],[1,1,1],[0,0,1]"  # the second floods the map, which only the job finds
    done = command(program, *what, "-m", levels, f"hydra/launcher={option}", folder=tmp_path)
    assert done.returncode == 2, done.stderr
    named = [line for line in done.stderr.splitlines() if line.startswith("error: job ")]
    assert len(named) == 1 and done.stderr.strip().endswith(named[0])
    assert named[0].startswith("error: job 1 (") and "levels=[1,1,1]) failed: " in named[0]
    assert "Traceback" not in done.stderr
    (sweep,) = (tmp_path / "multirun").glob("*/*")
    assert (sweep / "summary.md").read_text().strip() in done.stdout and (sweep / "summary.png").exists()
    assert [(sweep / job / "evaluation.json").exists() for job in "012"] == [True, False, True]


def test_a_launcher_that_gives_up_leaves_the_table_and_names_the_jobs_that_did_not_end(tmp_path, run_here, monkeypatch):
    make = Plugins.instantiate_launcher

    def make_weak(*args, **options):
        launcher = make(*args, **options)
        launch = launcher.launch

        def give_up(overrides, initial_job_idx):
            launch(overrides[:1], initial_job_idx)
            (tmp_path / "sweep" / "1").mkdir()
            (tmp_path / "sweep" / "1" / "evaluate.log").touch()
            raise RuntimeError("a worker was killed")

        launcher.launch = give_up
        return launcher

    monkeypatch.setattr(Plugins, "instantiate_launcher", make_weak)
    what = ("policy=noop,greedy", *BLIND[1:], "hydra.sweep.dir=sweep")
    code, errors, _ = run_here("evaluate.py", "-m", *what)
    assert code == 1 and "a worker was killed" in errors[-1]
    assert errors[-2] == f"error: the job in {Path('sweep', '1')} did not end"
    assert "noop" in (tmp_path / "sweep" / "summary.md").read_text()


MISTAKES = [
    (("train.py", "sede=3"), 2, "sede is not a key"),
    (("train.py", "team.n_agents=0"), 2, "team.n_agents must be in [1, 256], got 0"),
    (("train.py", "scenario=nowhere"), 2, "nowhere"),
    (("train.py", "+foo=1"), 2, "foo is not a key"),
    (("train.py", "-m", "seed=0,-1"), 2, "seed must be in 0..2147483648"),
    (("train.py", "scenario=landfire"), 2, "landscape.path must name"),
    (("train.py", "resume=nowhere"), 4, "nowhere is not a run folder"),
    (("evaluate.py",), 2, "give either checkpoint=PATH or policy=NAME"),
    (("evaluate.py", "policy=genius"), 2, "policy must be one of"),
    (("train.py", "algorithm.epochz=3", "--cfg", "job"), 2, "did you mean algorithm.epochs?"),
    (("train.py", "seeed=3", "--cfg", "job", "-p", "algorithm"), 2, "did you mean seed?"),
    (("evaluate.py", "policy=gredy"), 2, "did you mean greedy?"),
    (("train.py", "--total_frames", "1000"), 2, "keys are given as total_frames=1000"),
    (("train.py", "total_frames", "1000"), 2, "keys are given as total_frames=1000"),
    (("train.py", "hydra.run.dir=/a=b"), 2, "quote it, \"hydra.run.dir='/a=b'\""),
    (("train.py", "hydra.run.dri=a"), 2, "hydra.run.dri is not a key"),
    (("train.py", "hydra/launcher=jobli"), 2, "hydra/launcher must be one of basic"),
    (("train.py", "resume=default"), 4, "default is not a run folder"),
    (("train.py", "start_from=default"), 4, "was trained by another algorithm or other networks"),
    (
        ("evaluate.py", "checkpoint=skirmsh"),
        4,
        "default, generalist, single, skirmish, warp_v1: did you mean skirmish?",
    ),
    (("evaluate.py", "checkpoint=nowhere"), 4, "nowhere"),
]


LIKE_OTHERS = ("team.n_agents=0", "scenario=nowhere", "policy=genius", "hydra.run.dri=a", "start_from=default")
"""Mistakes that are found where another of these is, or of which another test asks."""


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [pytest.param(*each, marks=pytest.mark.slow if each[0][-1] in LIKE_OTHERS else ()) for each in MISTAKES],
    ids=lambda each: str(each)[:40],
)
def test_a_mistake_ends_with_its_code_and_one_line_and_leaves_nothing(
    tmp_path, monkeypatch, capsys, arguments, code, message
):
    program, *overrides = arguments
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [program, *overrides])
    with pytest.raises(SystemExit) as end:
        {"train.py": train, "evaluate.py": evaluate}[program]()
    assert end.value.code == code
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert message in line and line.startswith("error: ")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("evaluate.py", "policyy=x"), 2, "did you mean policy?"),
        (("train.py", "total_frame=3"), 2, "did you mean total_frames?"),
        pytest.param(*MISTAKES[-1], marks=pytest.mark.slow),  # the others are found before torch is imported
    ],
    ids=lambda each: str(each)[:40],
)
def test_a_mistake_in_a_process_of_its_own(tmp_path, arguments, code, message):
    done = command(*arguments, folder=tmp_path)
    assert done.returncode == code, done.stderr
    last = done.stderr.strip().splitlines()[-1]
    assert message in last and last.startswith("error: ")
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_training_in_a_process_of_its_own(trained, tmp_path):
    done = command("train.py", *TINY, "hydra.run.dir=run", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "coordinated" in done.stdout and "trained" in done.stdout
    assert weights_and_numbers(tmp_path / "run")[1] == weights_and_numbers(trained[0])[1]


def test_a_sweep_of_evaluations_ends_in_one_table_and_one_figure(tmp_path, run_here):
    pytest.importorskip("matplotlib")
    few = ("landscape.size=12", "horizon=20", "evaluation.episodes=4", "evaluation.baselines=[]", "picture=null")
    what = (*few, "hydra.sweep.dir=sweep")
    code, errors, said = run_here("evaluate.py", "-m", "policy=noop,greedy", *what)
    assert code == 0, errors
    text = (tmp_path / "sweep" / "summary.md").read_text()
    assert "| skirmish landscape.size=12 horizon=20 | greedy | 1 | 4 |" in text and text.strip() in said
    assert (tmp_path / "sweep" / "summary.png").stat().st_size > 10_000


def test_a_picture_of_another_kind_takes_the_former_one_s_place(run_here, tmp_path):
    pytest.importorskip("viser", reason="needs the extra live")
    for kind in ("gif", "html"):
        code, errors, _ = run_here("evaluate.py", *NOOP, f"picture={kind}", "hydra.run.dir=seen", "overwrite=true")
        assert code == 0, errors
    assert [each.name for each in (tmp_path / "seen").glob("episode.*")] == ["episode.html"]
