"""Plug-ins: what they add, who imports them, and what a run records of them."""

import importlib
import os
import subprocess
import sys
import textwrap
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

import pytest
from hydra.core.config_store import ConfigStore

from tests.world.mechanics.there import needs
from warp_torchrl import load_policy, make_env, register
from warp_torchrl.algorithms.dqn import Dqn
from warp_torchrl.commands.program import flag_arguments, run_program
from warp_torchrl.env.metrics import METRICS
from warp_torchrl.env.observation import CHANNELS
from warp_torchrl.env.reward import Adaptive, Reward
from warp_torchrl.heuristics import HEURISTICS, TEACHERS, Heuristic
from warp_torchrl.live.learning import arguments
from warp_torchrl.live.match import Match, Setting
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config import construction, plugins
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config, conf_folder, option_names
from warp_torchrl.runs.config.construction import ENVIRONMENT, WORLD_KEYS, ConfigError, build
from warp_torchrl.runs.config.plain_values import plain, without_targets
from warp_torchrl.runs.config.prediction import compose_prediction
from warp_torchrl.runs.config.saved_config import SavedConfig, environment_config, restore, world_overrides
from warp_torchrl.training.loop import Training

ROOT = Path(__file__).parents[3]
LAB = ROOT / "docs" / "examples" / "my_lab"
GAP = ["plugins=[my_lab]", "scenario=gap", "algorithm=surrogate"]
SMALL = [
    *("landscape.size=12", "horizon=16", "n_worlds=4", "collector.steps=8", "total_frames=32"),
    *("algorithm.minibatch_size=32", "model.actor_hidden=[8]", "model.critic_hidden=[8]", "evaluation.mode=sampled"),
]
TABLES = (HEURISTICS, TEACHERS, CHANNELS, METRICS, construction._ADDED, plugins._OPTIONS, plugins._OWNERS)


def forget(kept):
    """Undo what plug-ins have added, as in a process that has not imported any."""
    for table, before in zip((*TABLES, plugins._FOLDERS, ConfigStore.instance().repo), kept, strict=True):
        table.clear()
        table.update({key: dict(each) if isinstance(each, dict) else each for key, each in before.items()})
    del plugins._LOADED[:]
    plugins._CHANGES.append("forgotten")
    for name in ("my_lab", "their_lab"):
        sys.modules.pop(name, None)


@pytest.fixture
def here(monkeypatch):
    """The template's folder is the current one; afterwards nothing of plug-ins is left. Yields what forgets them."""
    kept = [
        {key: dict(each) if isinstance(each, dict) else each for key, each in table.items()}
        for table in (*TABLES, plugins._FOLDERS, ConfigStore.instance().repo)
    ]
    monkeypatch.chdir(LAB)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield lambda: forget(kept)
    forget(kept)


def gap_run(folder):
    """Train the template's scenario for a moment, and return the configuration."""
    plugins.load(["my_lab"])
    values = plain(compose_config("train", [*GAP, *SMALL]))
    kept = {key: value for key, value in without_targets(values).items() if key not in ("resume", "debug")}
    choices = {"scenario": "gap", "wind": "cold_front", "reward": "alight", "algorithm": "surrogate"}
    folder.mkdir()
    Training(run_config(values), SavedConfig(choices=choices, values=kept), folder).train()
    return values


# What a plug-in adds


def test_the_template_keeps_to_its_own_tests(here, monkeypatch):
    monkeypatch.syspath_prepend(LAB)
    monkeypatch.delitem(sys.modules, "test_my_lab", raising=False)
    tests = importlib.import_module("test_my_lab")
    tests.test_the_scenario_has_what_the_lab_adds()
    tests.test_the_cost_of_fire_is_a_share_of_the_forest()
    assert len((LAB / "my_lab.py").read_text().splitlines()) <= 80


def test_a_class_is_an_option_with_its_fields_as_keys(here):
    @register("reward")
    @dataclass(frozen=True, kw_only=True)
    class CalmHTTPFire(Adaptive):
        """Mine."""

        cost: float = 0.25

    made = compose_config("train", ["reward=calm_http_fire", "reward.terms.front=0.5"]).reward
    assert made.cost == 0.25 and made.terms.front == 0.5
    assert build(plain(made), "reward") == CalmHTTPFire(terms={**Adaptive().terms, "front": 0.5})
    with pytest.raises(ConfigError, match=r"reward\.cots is not a key of the configuration: did you mean reward\.cost"):
        compose_config("train", ["reward=calm_http_fire", "reward.cots=1"])


def test_a_baseline_teaches_if_it_has_no_memory(here):
    @register("heuristic", "mine")
    class Mine(Heuristic):
        """Mine."""

        is_stateful = True

    plugins.load(["my_lab"])
    assert "mine" in HEURISTICS and "mine" not in TEACHERS and "sentry" in TEACHERS
    assert run_config(plain(compose_config("train", ["evaluation.baselines=[sentry,mine]"]))).plugins == (
        "my_lab",
        __name__,
    )


@pytest.mark.parametrize(
    "kind, made, message",
    [
        ("rewrd", Reward, "kind must be one of .*: did you mean reward"),
        ("reward", object(), "must be a frozen dataclass"),
        ("reward", type("Mine", (), {}), "must be a frozen dataclass"),
        ("reward", dataclass(type("Mine", (), {})), "must be a frozen dataclass"),
        ("reward", dataclass(frozen=True)(type("Mine", (), {"__annotations__": {"a": int}})), "Mine.a has none"),
        ("reward", dataclass(frozen=True)(type("Efficiency", (), {})), "reward=efficiency must have a new name"),
        ("heuristic", Dqn, "must be a class that extends Heuristic"),
    ],
)
def test_what_cannot_be_registered_is_refused(here, kind, made, message):
    with pytest.raises(ValueError, match=message):
        register(kind)(made) if hasattr(made, "__name__") else register(kind, "mine")(made)


def test_a_plug_in_may_hold_yaml_files(here, tmp_path, monkeypatch):
    package = tmp_path / "their_lab"
    for folder, file, text in (
        ("scenario", "gust", "# @package _global_\ndefaults: [override /wind: gale]\nscenario: gust\nhorizon: 9\n"),
        ("wind", "gale", "_target_: warp_torchrl.world.air.wind.Uniform\nspeed: 20.0\n"),
        ("reward", "evil", "_target_: os.system\n"),
    ):
        (package / "conf" / folder).mkdir(parents=True)
        (package / "conf" / folder / f"{file}.yaml").write_text(text)
    (package / "__init__.py").write_text("")
    monkeypatch.chdir(tmp_path)
    env = make_env("gust", n_worlds=1, plugins=["their_lab"])
    assert env.world.horizon == 9 and env.world.wind.speed == 20.0
    assert "gust" in option_names("scenario") and "gale" in option_names("wind")
    composed = plain(compose_config("train", ["scenario=gust"]))
    assert composed["plugins"] == ["their_lab"], "which holds the scenario"
    assert world_overrides(plain(compose_config("train", ["wind=gale"]))) == ["wind.speed=20.0"]
    with pytest.raises(ConfigError, match=r"reward\._target_ must be a component of warp_torchrl, got os\.system"):
        make_env("gust", overrides=["reward=evil"])


def test_a_yaml_file_with_the_name_of_ours_is_refused(here, tmp_path, monkeypatch):
    (tmp_path / "their_lab" / "conf" / "wind").mkdir(parents=True)
    (tmp_path / "their_lab" / "__init__.py").write_text("")
    (tmp_path / "their_lab" / "conf" / "wind" / "calm.yaml").write_text("speed: 1.0\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match="wind=calm must have a new name"):
        plugins.load(["their_lab"])


# Who imports


def test_a_plug_in_that_is_not_there_is_told_from_one_that_cannot_import(here, tmp_path, monkeypatch):
    (tmp_path / "their_lab.py").write_text("import a_library_that_is_missing\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match="there is no my_lap"):
        plugins.load(["my_lap"])
    with pytest.raises(ModuleNotFoundError, match="a_library_that_is_missing"):
        make_env("default", plugins=["their_lab"])
    for wrong in ("my_lab", ModuleType("my_lab")):
        with pytest.raises(ConfigError, match="plugins must be a list"):
            plugins.load(wrong)
    with pytest.raises(ConfigError, match="must be names of modules"):
        plugins.load(["../my_lab"])


def test_installed_packages_are_plug_ins_by_their_entry_points(here, tmp_path, monkeypatch):
    about = tmp_path / "their_lab-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: their_lab\nVersion: 1\n")
    (about / "entry_points.txt").write_text(f"[{plugins.ENTRY_POINTS}]\nlab = their_lab\n")
    (tmp_path / "their_lab.py").write_text(
        "from warp_torchrl import add_scenario\nadd_scenario('theirs', ['horizon=7'])\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    plugins._installed.cache_clear()
    try:
        assert make_env("theirs", n_worlds=1).world.horizon == 7
    finally:
        monkeypatch.undo()
        plugins._installed.cache_clear()


def test_a_file_imports_no_plug_in(here, tmp_path):
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "evil.yaml").write_text("# @package _global_\nplugins: [my_lab]\n")
    with pytest.raises(ConfigError, match=r"plugins=\[my_lab\] must be given"):
        compose_config("train", [f"hydra.searchpath=[file://{tmp_path}]", "experiment=evil"])
    with pytest.raises(ConfigError, match=r"plugins=\[my_lab\] must be given"):
        restore(SavedConfig(choices={"scenario": "default"}, values={"plugins": ["my_lab"]}))
    with pytest.raises(ConfigError, match="plugins must be a list of modules"):
        restore(SavedConfig(choices={"scenario": "default"}, values={"plugins": "os; my_lab"}))
    assert "my_lab" not in sys.modules


def test_commands_import_what_they_list(here, capsys):
    assert run_program(["plugins=[my_lab]", "policy=sentry"], "", lambda given: print(*given)) == 0
    assert capsys.readouterr().out == "plugins=[my_lab] policy=sentry\n" and "sentry" in HEURISTICS
    assert flag_arguments(["RUN", "plugins=[my_lab]", "--mode", "sampled"]) == ["RUN", "--mode", "sampled"]
    assert compose_prediction(["plugins=[my_lab]"])["plugins"] == ["my_lab"]
    assert compose_config("calibrate", ["plugins=[my_lab]"]).plugins == ["my_lab"]
    assert run_program(["plugins=my_lab"], "", lambda given: None) == 2
    assert "plugins must be a list, plugins=[my_lab]" in capsys.readouterr().err


# What a run records


def test_a_run_needs_its_plug_ins_and_imports_none(here, tmp_path):
    values = gap_run(tmp_path / "run")
    found, _ = checkpoints.newest(tmp_path / "run")
    assert found.saved_config().values["plugins"] == ["my_lab"]
    assert environment_config(values).values["plugins"] == ["my_lab"], "as recordings keep it"
    here()
    with pytest.raises(ConfigError, match=r"plugins=\[my_lab\] must be given"):
        load_policy(tmp_path / "run")
    assert "my_lab" not in sys.modules
    policy = load_policy(tmp_path / "run", plugins=["my_lab"])
    env = make_env("gap", n_worlds=2, overrides=policy.overrides)
    assert policy.fitted(env)(env.reset())["agents", "action"].shape == (2, 3)
    assert plain(restore(found.saved_config())) == {**values, "resume": None, "debug": False}
    run = run_config(plain(restore(found.saved_config())))
    assert run.plugins == ("my_lab",)


def test_a_worker_imports_the_plug_ins_of_its_worlds(here):
    plugins.load(["my_lab"])
    run = run_config(plain(compose_config("train", ["observation.channels=[off_map,fire_stage,sapling]", *SMALL])))
    assert run.plugins == ("my_lab",), "whose channel the view has"
    here()
    assert "sapling" not in CHANNELS
    assert run.make_env(1, 0).channel_names["view"][-1] == "sapling"


def test_the_live_page_shows_a_plug_in_and_hands_it_on(here, tmp_path):
    gap_run(tmp_path / "run")
    shown = Match(Setting(policy=str(tmp_path / "run"), beside="sentry", overrides=("plugins=[my_lab]",)))
    assert shown.scenario == "gap"
    found, _ = checkpoints.newest(tmp_path / "run")
    for overrides in ((), ("plugins=[my_lab]",)):
        given = arguments("run", found.saved_config(), overrides, tmp_path, tmp_path / "next", 64)
        assert [each for each in given if "plugins" in each] == ["plugins=[my_lab]"]


# Worlds alone


COMPOSED = ("agencies", "front", "haksar", "paper_marl", "skirmish", "spread_shift", "wildland", "wui")
"""Scenarios of the quick suite, which between them choose options of most groups that worlds have."""


@pytest.mark.parametrize(
    "scenario",
    [
        pytest.param(path.stem, marks=() if path.stem in COMPOSED else pytest.mark.slow)
        for path in sorted((conf_folder() / "scenario").glob("*.yaml"))
    ],
)
def test_worlds_are_composed_as_a_training_composes_them(scenario):
    alone, whole = (plain(compose_config(name, [f"scenario={scenario}"])) for name in ("worlds", "train"))
    for key in (*WORLD_KEYS, *ENVIRONMENT):
        assert alone[key] == whole[key], key


@needs("flight")
def test_an_environment_of_a_training_s_keys_has_no_others(here):
    assert make_env("skirmish", n_worlds=1, overrides=["experiment=quick", "mechanics.flight={}"]).world.mechanics
    with pytest.raises(ConfigError, match="mine is not a key of the configuration"):
        make_env("skirmish", overrides=["+mine=1"])


def test_a_library_that_a_component_lacks_is_named(monkeypatch):
    def lacking(name):
        raise ModuleNotFoundError("No module named 'torchrl.objectives'", name="torchrl.objectives")

    monkeypatch.setattr(construction.importlib, "import_module", lacking)
    with pytest.raises(ModuleNotFoundError, match=r"torchrl\.objectives"):
        construction.component("warp_torchrl.algorithms.ppo.Ppo")
    monkeypatch.undo()
    assert construction.component("warp_torchrl.algorithms.nothing.Ppo") is None


@pytest.mark.slow
def test_an_environment_needs_no_learner_and_a_learner_says_what_is_missing():
    code = """
        import sys
        sys.modules["torchrl.objectives"] = None  # as where a library lacks what learners need
        from warp_torchrl import make_env
        assert make_env("front", n_worlds=1).world.team.n_agents == 3
        assert not [name for name in sys.modules if name.startswith(("warp_torchrl.algorithms", "warp_torchrl.models"))]
        try:
            make_env("front", n_worlds=1, overrides=["algorithm.gamma=0.9"])
        except ImportError as error:
            print(error)
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0 and "torchrl.objectives" in done.stdout, done.stderr


def test_an_unknown_scenario_is_refused_before_training():
    values = plain(compose_config("train", []))
    with pytest.raises(ConfigError, match=r"scenario must be one of .*, got mine; runs in another could not be read"):
        run_config({**values, "scenario": "mine"})


def test_a_saved_configuration_of_another_choice_is_refused(here):
    plugins.load(["my_lab"])
    saved = SavedConfig(choices={"scenario": "gap"}, values={"plugins": ["my_lab"]})
    here()
    plugins.load(["my_lab"])
    assert restore(saved).wind["_target_"] == "my_lab.ColdFront"
    with pytest.raises(ConfigError, match="wind must be one of"):
        restore(replace(saved, choices={"wind": "os"}))
