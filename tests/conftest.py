"""Small worlds that the tests of the upper floors share.

The process that hands the tests out to others reads this file too: torch and the package are imported where they are
used, which spares that process six seconds before the others begin.
"""

import gc
import logging
import os
import shutil
from pathlib import Path

import pytest

os.environ.setdefault("OMP_NUM_THREADS", "1")  # the tests run side by side; read when torch is imported

TESTS = Path(__file__).parent
OF_DOCS = TESTS.parent / "docs" / "experiment"
"""Experiments that serve one table of the docs."""
QUICK = (
    "algorithms/test_ppo.py",
    "env/reward/test_base.py",
    "env/reward/test_paper.py",
    "api/test_make.py",
    "test_architecture.py",
    "env/observation/test_channels.py",
    "runs/test_checkpoint.py",
    "runs/config/test_conf.py",
    "env/test_wildfire.py",
    "test_golden.py",
    "env/test_metrics.py",
    "env/observation/test_observation.py",
    "evaluation/test_statistics.py",
    "world/arrays/test_batch.py",
    "world/fires/test_burn.py",
    "world/law/test_fire.py",
    "world/ignition/test_ignition.py",
    "world/terrain/test_landscape.py",
    "world/law/test_law.py",
    "world/test_laws.py",
    "world/arrays/test_random.py",
    "world/team/test_team.py",
    "world/air/test_wind.py",
)
"""The files of ``pytest -m quick``: the laws of the world, the environment and its specs, configuration, one learner,
checkpoints there and back, and who may import whom. Of a minute on two free cores they may take a half."""


def pytest_collection_modifyitems(items):
    for item in items:
        takes_long = item.get_closest_marker("slow") or item.get_closest_marker("stress")
        if item.path.relative_to(TESTS).as_posix() in QUICK and not takes_long:
            item.add_marker(pytest.mark.quick)


def pytest_collection_finish():
    """Have Python no longer look for garbage among what was imported and collected: a fifth of the tests' time."""
    gc.collect()
    gc.freeze()


def small_world(**changes):
    """A 12 x 12 world with two bulldozers whose fire ticks every third step."""
    from warp_torchrl.world.air.wind import Uniform
    from warp_torchrl.world.ignition.ignition import Ignition
    from warp_torchrl.world.team.team import Team
    from warp_torchrl.world.terrain.landscape import Perlin
    from warp_torchrl.world.world import World

    parts = {
        "landscape": Perlin(size=12, relief=40.0),
        "wind": Uniform(speed=4.0),
        "team": Team(n_agents=2),
        "ignition": Ignition(count=1),
        "steps_per_tick": 3,
        "horizon": 40,
    }
    return World(**{**parts, **changes})


@pytest.fixture(autouse=True)
def _quiet_log():
    """Log warnings alone, whatever a command that ran in this process has set."""
    logging.getLogger().setLevel(logging.WARNING)
    logging.getLogger("warp_torchrl").setLevel(logging.NOTSET)


@pytest.fixture(autouse=True)
def _short_look_ahead(monkeypatch):
    """Let the planner look ahead for three steps, so that tests of all heuristics stay quick."""
    from warp_torchrl.heuristics import Rollout

    monkeypatch.setattr(Rollout, "horizon", 3)
    monkeypatch.setattr(Rollout, "samples", 2)


@pytest.fixture
def blank_figures(monkeypatch):
    """Leave Matplotlib's figures undrawn, which takes most of the time of a short command; their files are there."""
    figure, image = pytest.importorskip("matplotlib.figure"), pytest.importorskip("PIL.Image")
    blank = image.new("RGB", (1, 1))
    monkeypatch.setattr(figure.Figure, "savefig", lambda figure, file, **options: blank.save(file, "png"))


@pytest.fixture
def make_small_env():
    """Make an environment of small worlds; keywords of World and of WildfireEnv."""
    from warp_torchrl.env import WildfireEnv

    def make(n_worlds=4, world=None, **options):
        return WildfireEnv(world or small_world(), n_worlds=n_worlds, **options)

    return make


@pytest.fixture(scope="session")
def _conf_with_docs(tmp_path_factory):
    from warp_torchrl.runs.config.compose import conf_folder

    folder = tmp_path_factory.mktemp("all") / "conf"
    shutil.copytree(conf_folder(), folder)
    for group in ("experiment", "mixture"):
        shutil.copytree(OF_DOCS.parent / group, folder / group, dirs_exist_ok=True)
    return folder


@pytest.fixture
def all_experiments(_conf_with_docs, monkeypatch):
    """Let experiments and mixtures of the docs stand beside those of the package, as ``--config-dir docs`` does."""
    monkeypatch.setattr("warp_torchrl.runs.config.compose.conf_folder", lambda: _conf_with_docs)


@pytest.fixture(autouse=True, scope="session")
def _quick_defaults():
    """Spare Hydra the map of choices that it makes for each file of a configuration, and reads where one has ``${``.

    To compose a configuration takes a third less time.
    """
    from hydra._internal import defaults_list

    make = defaults_list._create_interpolation_map

    def made_if_read(overrides, defaults, self_added):
        is_read = any(not each.is_self() and each.is_interpolation() for each in defaults)
        return make(overrides, defaults, self_added) if is_read else None

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(defaults_list, "_create_interpolation_map", made_if_read)
        yield


@pytest.fixture(autouse=True, scope="session")
def _no_files_at_home(tmp_path_factory):
    os.environ["XDG_CACHE_HOME"] = str(tmp_path_factory.mktemp("cache"))


@pytest.fixture(autouse=True)
def _same_start():
    import torch

    torch.manual_seed(0)


@pytest.fixture(scope="session")
def weak_run(tmp_path_factory):
    """The folder of a run of two agents that has hardly learned."""
    from warp_torchrl.runs.config.building import run_config
    from warp_torchrl.runs.config.compose import compose_config
    from warp_torchrl.runs.config.plain_values import plain, without_targets
    from warp_torchrl.runs.config.saved_config import SavedConfig
    from warp_torchrl.training.loop import Training

    folder = tmp_path_factory.mktemp("weak")
    overrides = ["landscape.size=12", "horizon=16", "n_worlds=4", "collector.steps=8", "total_frames=32"]
    small = [
        "algorithm.minibatch_size=32",
        "model.actor_hidden=[8]",
        "model.critic_hidden=[8]",
        "evaluation.mode=sampled",
    ]
    config = compose_config("train", [*overrides, *small])
    values = {k: v for k, v in without_targets(plain(config)).items() if k not in ("resume", "debug")}
    choices = {"algorithm": "mappo", "reward": "efficiency", "observation": "surroundings", "scenario": "skirmish"}
    Training(run_config(plain(config)), SavedConfig(choices=choices, values=values), folder).train()
    return folder
