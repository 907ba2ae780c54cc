"""Every yaml builds, says what its class says, and mistakes are told with key, value and rule."""

import shutil
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf
from torch._inductor.exc import InvalidCxxCompiler

from tests.conftest import OF_DOCS
from tests.world.mechanics.there import can_play, needs
from warp_torchrl.api.make import make_env
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config, conf_folder
from warp_torchrl.runs.config.construction import COMPONENTS, ConfigError, build, component
from warp_torchrl.runs.config.defaults import defaults
from warp_torchrl.runs.config.plain_values import plain, without_targets
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.config.saved_config import SavedConfig, read_saved_config, restore, world_overrides
from warp_torchrl.world.air.gridded import Gridded
from warp_torchrl.world.air.weather import Weather
from warp_torchrl.world.ignition.file import IgnitionFile
from warp_torchrl.world.law.fire import Slopes
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.array import Array
from warp_torchrl.world.terrain.raster import Raster
from warp_torchrl.world.world import World

NEED_A_FOLDER = ("attack_landfire", "landfire", "spread_landfire", "wildland")
SCENARIOS = sorted(path.stem for path in (conf_folder() / "scenario").glob("*.yaml") if path.stem not in NEED_A_FOLDER)
EXPERIMENTS = sorted(path.stem for folder in (conf_folder() / "experiment", OF_DOCS) for path in folder.glob("*.yaml"))
OPTIONS = [(path.parent.name, path.stem) for path in sorted(conf_folder().glob("*/*.yaml"))]
LANDFIRE = Path(__file__).parents[4] / "shared" / "landscapes" / "landfire"


def composed(group, option):
    """Return an option as Hydra composes it, beside options of other groups: one composition for one of each group."""
    of_group = {each: [name for of, name in OPTIONS if of == each] for each in COMPONENTS}
    place = of_group[group].index(option)
    beside = [f"{each}={names[place]}" for each, names in of_group.items() if place < len(names)]
    return plain(compose_config("train", ["scenario=default", *beside]))[group]


@pytest.mark.parametrize(("group", "option"), [each for each in OPTIONS if each[0] in COMPONENTS])
def test_every_option_builds_and_shows_every_field(group, option):
    if (group, option) == ("collector", "ray"):
        pytest.importorskip("ray", reason="Ray is not installed")
    node = composed(group, option)
    needs_a_file = {"raster": Raster, "array": Array, "file": IgnitionFile, "gridded": Gridded, "weather": Weather}
    if option in needs_a_file:
        with pytest.raises(ConfigError, match=rf"{group}\.path must name"):
            build(node, group)
        made = needs_a_file[option]
    else:
        made = build(node, group)
    assert set(node) - {"_target_"} == {each.name for each in fields(made) if each.init} - _derived(made)


@pytest.mark.parametrize(("group", "option"), [each for each in OPTIONS if each[0] in COMPONENTS])
def test_no_option_repeats_a_default_of_its_class(group, option):
    held = OmegaConf.to_container(OmegaConf.load(conf_folder() / group / f"{option}.yaml"), resolve=False)
    usual = defaults(component(held.pop("_target_")))
    assert not [name for name, value in held.items() if name in usual and usual[name] == value]


ONE_FOR_A_CLASS = [
    *("mappo", "a2c", "dqn", "sac", "ddpg"),
    *("efficiency", "coverage", "collaborative", "adaptive"),
    *("perlin", "uniform", "wandering", "calm", "spread", "hazard", "lattice", "ugv"),
    *("central", "square", "surroundings", "local", "at_fire", "round_fire"),
    *("mlp", "cnn", "direct", "process", "csv", "wandb", "tensorboard"),
]


@pytest.mark.parametrize("option", ONE_FOR_A_CLASS)
def test_a_class_without_arguments_is_its_option(option):
    ((group, _),) = [each for each in OPTIONS if each[1] == option and each[0] in COMPONENTS]
    node = composed(group, option)
    assert component(node["_target_"])() == build(node, group)


def test_a_world_without_arguments_is_default_under_the_law_of_the_report():
    world = run_config(plain(compose_config("train", ["scenario=spread_default"]))).world
    assert replace(world, mechanics=()) == World(), "a radio without limits, which carries what networks say, is all"
    assert make_env().world == run_config(plain(compose_config("train", ["scenario=default"]))).world


@pytest.mark.parametrize("name", [each for each in SCENARIOS if f"spread_{each}" in SCENARIOS])
def test_where_a_scenario_is_one_of_law_spread_too_more_wind_burns_more_in_it(name):
    # tests/world/test_laws.py shows it of these refinements.
    fire = build(compose_config("train", [f"scenario={name}"]).fire, "fire")
    assert isinstance(fire, HazardFire) and fire.kernel == "fbp" and fire.refinement >= 8


def test_no_scenario_repeats_a_default_but_its_size_which_each_landscape_has_another_of():
    for path in (conf_folder() / "scenario").glob("*.yaml"):
        held = OmegaConf.to_container(OmegaConf.load(path), resolve=False)
        if any(isinstance(each, str) for each in held.get("defaults", ())):
            continue  # it follows another scenario, of whose values it may make defaults again
        composed = compose_config("train", [f"scenario={path.stem}"])
        for name, value in held.items():
            if name in COMPONENTS:
                usual = defaults(component(composed[name]["_target_"]))
                assert not [key for key in value if value[key] == usual[key] and key != "size"], path.stem


def test_an_environment_is_composed_of_the_options_of_a_training():
    # worlds.yaml says them again, for it has none of the learner's.
    def options(name):
        listed = OmegaConf.load(conf_folder() / name)["defaults"]
        return {group: option for each in listed if each != "_self_" for group, option in each.items()}

    assert len(options("worlds.yaml")) == 11
    assert options("worlds.yaml").items() <= options("train.yaml").items()


def test_train_yaml_repeats_no_default_of_a_run():
    held = OmegaConf.load(conf_folder() / "train.yaml")
    assert not set(held) & {*defaults(RunConfig), *defaults(World)} - {*COMPONENTS, "mechanics"}


def test_a_folder_of_the_users_own_is_filled_in_too(tmp_path):
    (tmp_path / "reward").mkdir()
    (tmp_path / "reward" / "mine.yaml").write_text("_target_: warp_torchrl.env.reward.Efficiency\nact: 0.25\n")
    (tmp_path / "top.yaml").write_text("defaults: [{reward: mine}]\n")
    with initialize_config_dir(str(tmp_path), version_base="1.3"):
        reward = compose("top", overrides=["reward.preserved=2.0"]).reward
        assert (reward.act, reward.preserved, reward.burned) == (0.25, 2.0, 1.0)
        with pytest.raises(Exception, match="preserve"):
            compose("top", overrides=["reward.preserve=2.0"])


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("act: ${oc.env:HOME}", r"mine\.yaml must hold plain values, and references"),
        ("act: [{a: 'x${oc.create:{a:5}}'}]", r"mine\.yaml must hold plain values, and references"),
        ("act: .nan", "numbers must be finite, got nan"),
        ("act: &a [1]\nburned: *a", "has an alias"),
        ("act: !!python/name:os.system", "has a tag"),
        ("act: 1\nact: 2", "has the key act once more"),
    ],
)
def test_an_option_that_does_more_than_hold_values_is_refused(tmp_path, line, told):
    (tmp_path / "reward").mkdir()
    (tmp_path / "reward" / "mine.yaml").write_text(f"_target_: warp_torchrl.env.reward.Efficiency\n{line}\n")
    (tmp_path / "top.yaml").write_text("defaults: [{reward: mine}]\n")
    with initialize_config_dir(str(tmp_path), version_base="1.3"), pytest.raises(ValueError, match=told) as raised:
        compose("top")
    assert "\n" not in str(raised.value)


def test_a_file_that_builds_on_another_keeps_its_values_and_has_its_own_class_s_fields_too(tmp_path):
    (tmp_path / "base.yaml").write_text("_target_: warp_torchrl.world.law.fire.Fire\nbeta: 0.5\n")
    built_on = "defaults: [base, _self_]\n_target_: warp_torchrl.world.law.hazard.HazardFire\ntau: 3.0\n"
    (tmp_path / "top.yaml").write_text(built_on)
    with initialize_config_dir(str(tmp_path), version_base="1.3"):
        fire = compose("top")
    assert (fire.beta, fire.tau, fire.refinement, fire.slope_gain) == (0.5, 3.0, 24, 0.115)


@pytest.mark.parametrize(
    ("overrides", "group", "key"),
    [
        (["scenario=landfire", "ignition=file"], "ignition", "count"),
        (["scenario=hazard", "wind=calm"], "wind", "speed"),
    ],
)
def test_what_a_scenario_says_of_an_option_goes_with_the_option(overrides, group, key):
    assert key in plain(compose_config("train", overrides[:1]))[group]
    chosen = plain(compose_config("train", overrides))[group]
    assert set(chosen) == {"_target_", *defaults(component(chosen["_target_"]))} and key not in chosen
    kept = plain(compose_config("train", [*overrides, f"{group}.{key}=1"]))[group]  # the user's own mistake stays
    with pytest.raises(ConfigError, match=rf"{group}\.{key} is not a key of {group}"):
        build(kept, group)


def _derived(component):
    return {each.name for each in fields(component) if each.name.startswith("_")}


@pytest.mark.parametrize("scenario", ["single", "default"])
def test_the_whole_array_runs_in_every_scenario(scenario, tmp_path):
    np.savez(tmp_path / "land.npz", cover=np.full((40, 50), 3))
    overrides = [f"scenario={scenario}", "landscape=array", f"landscape.path={tmp_path / 'land.npz'}"]
    plan = run_config(plain(compose_config("train", overrides)))
    env = plan.make_env(2, 0)
    env.reset()
    assert env.world_state.cover.shape == (2, 40, 50)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_every_scenario_is_a_run(scenario):
    plan = run_config(plain(compose_config("train", [f"scenario={scenario}"])))
    side = plan.world.size[0]
    ends = {"haksar": 48 * side, "initial_attack": 360, "wui": 240, "extended": 480}  # until it is out; for hours
    assert plan.scenario == scenario and plan.world.horizon == ends.get(scenario, 8 * side)


@pytest.mark.parametrize("experiment", EXPERIMENTS)
@pytest.mark.usefixtures("all_experiments")
def test_every_experiment_is_a_run(experiment):
    if experiment == "believing":
        pytest.importorskip("warp_torchrl.world.mechanics.radio.radio", reason="a team believes together by radio")
    values = plain(compose_config("train", [f"experiment={experiment}"]))
    if values["device"] == "cuda" and not torch.cuda.is_available():
        with pytest.raises(
            ConfigError, match=r"device must be one of this machine's 0 CUDA devices.*choose device=cpu"
        ):
            run_config(values)
        values["device"] = "cpu"
    plan = run_config(values)
    assert plan.total_frames >= plan.n_worlds * plan.collector.steps


def test_the_landfire_scenario_runs_on_its_raster():
    if not LANDFIRE.is_dir():
        pytest.skip(f"no landscape at {LANDFIRE}")
    pytest.importorskip("rasterio")
    plan = run_config(plain(compose_config("train", ["scenario=landfire", f"landscape.path={LANDFIRE}"])))
    env = plan.make_env(2, 0)
    env.rollout(6, break_when_any_done=False)
    assert isinstance(env.world_state.ground.terms, Slopes) and env.world.side_of_cell == 30.0


@needs("values", "lines", "breach", "arrivals")
def test_initial_attack_on_real_ground_steps_on_its_raster():
    if not LANDFIRE.is_dir():
        pytest.skip(f"no landscape at {LANDFIRE}")
    pytest.importorskip("rasterio")
    keys = ["scenario=attack_landfire", f"landscape.path={LANDFIRE}", "landscape.size=24"]
    env = run_config(plain(compose_config("train", keys))).make_env(2, 0)
    now = env.rollout(3, break_when_any_done=False)
    assert env.world.goal == "escaped" and (now["next", "info", "fire_size"] > 0.0).all()


def test_the_landfire_scenario_has_no_path_of_its_own():
    with pytest.raises(ConfigError, match=r"landscape\.path"):
        run_config(plain(compose_config("train", ["scenario=landfire"])))


MISTAKES = [
    ("sede=1", "sede"),
    ("+sede=1", "sede is not a key"),
    ("team.n_agent=3", "n_agent"),
    ("+team.n_agent=3", r"team\.n_agent is not a key"),
    ("sede=1", r"sede is not a key of the configuration: did you mean seed\?"),
    ("+sede=1", r"did you mean seed\?"),
    ("algorithm.gama=0.9", r"algorithm\.gama is not a key of the configuration: did you mean algorithm\.gamma\?"),
    ("+algorithm.gama=0.9", r"algorithm\.gama is not a key of algorithm; .*: did you mean algorithm\.gamma\?"),
    ("sceanrio=large", r"did you mean scenario\?"),
    ("experimnt=default", r"did you mean experiment\?"),
    ("wind=calm radius=3", r"did you mean .*observation\.radius\?"),
    ("checkpoint.intervall=9", r"did you mean checkpoint\.interval\?"),
    ("scenario=skirmsh", r"scenario must be one of .*, got skirmsh: did you mean skirmish\?"),
    ("imitation.teacher=locl", r"imitation\.teacher must be .*: did you mean local\?"),
    ("evaluation.mode=sampld", r"evaluation\.mode must be .*: did you mean sampled\?"),
    ("landscape.path=/data", r"is not a key of the configuration, but with landscape=array or landscape=raster"),
    ("algorithm.gamma=0.9,0.99", r"has several values: -m sweeps over them"),
    ("scenario=single,large", r"scenario must be one of .*; -m sweeps over several"),
    ("landscape=raster landscape.path=/a=b", r"""quote it, "landscape\.path='/a=b'\""""),
    ("total_frames=1.5", "total_frames must be a whole number, got 1.5"),
    ("n_worlds=.inf", "n_worlds must be a whole number"),
    ("collector.steps=0.5", r"collector\.steps must be a whole number, got 0\.5"),
    ("scenario=nowhere", r"scenario must be one of .*default, .*, water, wildland, got nowhere"),
    ("algorithm=sarsa", r"algorithm must be one of a2c, ddpg, .*, got sarsa"),
    ("experiment=nowhere", r"experiment must be one of .*default, .*, got nowhere"),
    ("n_worlds=0", "n_worlds must be in 1..1048576, got 0"),
    ("n_worlds=many", "n_worlds must be a whole number, got 'many'"),
    ("n_worlds=1.5", "n_worlds must be a whole number"),
    ("total_frames=-1", "total_frames must be"),
    ("seed=-1", "seed must be in 0..2147483648, got -1"),
    ("seed=2147483649", "seed must be in 0..2147483648, got 2147483649"),
    ("seed=1.5", "seed must be a whole number"),
    ("evaluation.first_seed=2305843009213693952", r"evaluation\.first_seed must be in 0..2305843009213693696, so"),
    ("device=tpu", "device must be"),
    ("device=cuda:99", "device must be"),
    ("steps_per_tick=0", "steps_per_tick must be"),
    ("horizon=0", "horizon must be"),
    ("landscape.size=3", r"landscape\.size must be"),
    ("landscape.size=[8]", r"landscape\.size must be"),
    ("landscape.levels=[0.5,0.2,0.1]", r"landscape\.levels must be in order"),
    ("landscape=raster landscape.table=fbfm", r"landscape\.table must be one of .*, got fbfm: did you mean"),
    ("landscape.thresholds=median", r"landscape\.thresholds must be quantile or minmax or printed"),
    ("wind.speed=-1", r"wind\.speed must be"),
    ("wind.speed=.nan", r"wind\.speed must be"),
    ("fire.alpha=[0,1,2,3,4]", r"fire\.alpha must be"),
    ("fire.p_regrow=2", r"fire\.p_regrow must be"),
    ("team.n_agents=70", r"team\.n_agents must be"),
    ("team.roles=[tank]", r"team\.roles must be"),
    ("team.tnk=3", r"team\.tnk is not a key of the configuration: did you mean team\.tank\?"),
    ("+team.tnk=3", r"team\.tnk is not a key of team; it has n_agents, .*: did you mean team\.tank\?"),
    (
        "mechanics.radio.rang=3",
        r"mechanics\.radio\.rang is not a key of mechanics\.radio; it has carries, range, .*: did you mean",
    ),
    ("mechanics.radio.range=-1", r"^mechanics\.radio\.range must be in \[0, 1e\+06\], got -1"),
    ("mechanics.radio.carries=maps", r"^mechanics\.radio\.carries must be none or map or graph or both, got 'maps'"),
    ("mechanics.radio=5", r"^mechanics\.radio must be a mapping, got 5"),
    ("mechanics.nothing.drift=0.1", r"^mechanics must be some of .*, got nothing"),
    ("mechanics=5", r"^mechanics must be a mapping, got 5"),
    ("ignition.count=0", r"ignition\.count must be"),
    ("observation.radius=2.5", r"observation\.radius must be a whole number"),
    ("reward.team_share=2", r"reward\.team_share must be"),
    ("reward.gamma=0.5", r"reward\.gamma must be algorithm\.gamma"),
    ("model.actor_hidden=[]", r"model\.actor_hidden must be"),
    ("algorithm.gamma=1.5", r"gamma must be"),
    ("algorithm.epochs=0", r"algorithm\.epochs must be"),
    ("collector.steps=0", r"collector\.steps must be"),
    ("checkpoint.keep=1", r"checkpoint\.keep must be"),
    ("checkpoint.minutes=-1", r"checkpoint\.minutes must be in 0\.\.1e6, where 0 saves by frames alone, got -1"),
    ("checkpoint.minutes=null", r"checkpoint\.minutes must be a number"),
    ("evaluation.mode=lucky", r"evaluation\.mode must be"),
    ("fire=null", "fire"),
    ("fire._target_=os.system", r"fire\._target_ must be a component of warp_torchrl, got os\.system"),
    ("fire._target_=warp_torchrl.runs.config.compose.conf_folder", r"fire\._target_ must be a component"),
]


@pytest.mark.parametrize(("override", "message"), [each for each in MISTAKES if can_play(each[:1])])
def test_mistakes_are_told_in_one_line(override, message):
    with pytest.raises(ConfigError, match=message) as error:
        run_config(plain(compose_config("train", override.split())))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["team/mine.yaml", "scenario/mine.yaml"])
def test_a_yaml_file_that_sets_a_part_of_a_component_leaves_the_rest_as_it_is(name, tmp_path, monkeypatch):
    shutil.copytree(conf_folder(), tmp_path / "conf")
    monkeypatch.setattr("warp_torchrl.runs.config.compose.conf_folder", lambda: tmp_path / "conf")
    part = {"tank": 5}
    own = {"_target_": "warp_torchrl.world.team.team.Team", **part}
    OmegaConf.save({"team": part} if name.startswith("scenario") else own, tmp_path / "conf" / name)
    if name.startswith("scenario"):
        path = tmp_path / "conf" / name
        path.write_text(f"# @package _global_\nscenario: mine\n{path.read_text()}")
    group = name.partition("/")[0]
    team = run_config(plain(compose_config("train", [f"{group}=mine", "team.extinguish_p=0.5"]))).world.team
    assert (team.tank, team.extinguish_p, team.allow_stay) == (5, 0.5, True)


def test_a_file_that_changes_is_read_again_and_else_once(tmp_path, monkeypatch):
    shutil.copytree(conf_folder(), tmp_path / "conf")
    monkeypatch.setattr("warp_torchrl.runs.config.compose.conf_folder", lambda: tmp_path / "conf")
    read, load = [], OmegaConf.load
    monkeypatch.setattr(OmegaConf, "load", lambda file: read.append(Path(file.name)) or load(file))
    mine = (tmp_path / "conf/wind/mine.yaml").resolve()
    for speed in (1.0, 2.0):
        OmegaConf.save({"_target_": "warp_torchrl.world.air.wind.Uniform", "speed": speed}, mine)
        for seed in (1, 2):
            config = compose_config("train", ["wind=mine", f"seed={seed}"])
            assert config.wind.speed == speed and "direction" in config.wind
    assert read.count(mine) == 2


def test_a_name_with_a_dot_is_the_name_of_its_own_file(tmp_path, monkeypatch):
    shutil.copytree(conf_folder(), tmp_path / "conf")
    monkeypatch.setattr("warp_torchrl.runs.config.compose.conf_folder", lambda: tmp_path / "conf")
    for seed, name in ((1, "mine"), (2, "mine.v2")):
        text = f"# @package _global_\nseed: {seed}\n"
        (tmp_path / "conf/experiment" / f"{name}.yaml").write_text(text)
    seeds = [compose_config("train", [f"experiment={name}"]).seed for name in ("mine", "mine.v2", "mine")]
    assert seeds == [1, 2, 1]


def test_components_are_made_of_plain_parts():
    node = {"_target_": "warp_torchrl.world.team.team.Team", "roles": ["ugv", "uav"]}
    assert build(node, "team") == Team(roles=("ugv", "uav"))


def test_a_number_that_is_whole_is_a_whole_number_however_it_is_written():
    overrides = ["total_frames=1e6", "collector.steps=6.4e1", "landscape.size=20.0", "observation.radius=3.0"]
    plan = run_config(plain(compose_config("train", [*overrides, "model.actor_hidden=[16.0]", "algorithm.epochs=2e0"])))
    numbers = [plan.total_frames, plan.collector.steps, plan.world.landscape.size, plan.observation.radius]
    numbers += [*plan.model.actor_hidden, plan.algorithm.epochs]
    assert numbers == [1_000_000, 64, 20, 3, 16, 2] and {type(each) for each in numbers} == {int}


def recorded(*overrides):
    config = compose_config("train", overrides)
    return SavedConfig(choices={"scenario": "single", "observation": "local"}, values=without_targets(plain(config)))


def test_a_recorded_configuration_comes_back():
    record = recorded("scenario=single", "observation=local", "seed=5", "team.n_agents=3")
    config = restore(record)
    assert config.seed == 5 and config.team.n_agents == 3 and config.scenario == "single"
    assert config.observation._target_.endswith("Local")


@pytest.mark.parametrize("override", ["reward.terms={front:0.2}", "reward.terms.front=0.2", "+reward.terms.front=0.2"])
def test_a_mapping_takes_keys_of_its_own(override):
    config = compose_config("train", ["reward=adaptive", override])
    assert config.reward.terms == {"front": 0.2}
    record = SavedConfig(choices={"reward": "adaptive"}, values=without_targets(plain(config)))
    assert run_config(plain(restore(record))).reward.terms == {"front": 0.2}
    with pytest.raises(ConfigError, match=r"reward\.trms\.front is not a key"):
        compose_config("train", ["reward=adaptive", "reward.trms.front=0.2"])


def test_overrides_come_before_what_is_recorded():
    record = recorded("scenario=single", "observation=local", "wind.speed=9")
    config = restore(record, ["team.n_agents=2", "fire=paper"])
    assert config.team.n_agents == 2 and config.fire.beta == 0.65 and config.wind.speed == 9


def test_another_scenario_takes_the_whole_world_from_it():
    config = restore(recorded("scenario=single", "observation=local", "wind.speed=9"), ["scenario=large"])
    assert config.team.n_agents == 8 and config.horizon == 512 and config.wind.speed == 4.0
    assert config.observation._target_.endswith("Local")


def test_classes_never_come_from_a_record():
    values = {"fire": {"_target_": "os.system"}}
    with pytest.raises(ConfigError, match=r"os\.system"):
        run_config(plain(restore(SavedConfig(choices={}, values=values))))
    for choices in ({"scenario": "../../evil"}, {"hydra": "x"}):
        with pytest.raises(ConfigError, match="not one of our options"):
            restore(SavedConfig(choices=choices, values={}))


def test_a_yaml_file_that_was_edited_is_read_anew(tmp_path, monkeypatch):
    shutil.copytree(conf_folder(), tmp_path / "conf")
    monkeypatch.setattr("warp_torchrl.runs.config.compose.conf_folder", lambda: tmp_path / "conf")
    first = compose_config("train", ["wind=calm"])
    first.horizon = 7  # the caller's own
    assert compose_config("train", ["wind=calm"]).horizon == 128
    (tmp_path / "conf" / "scenario" / "skirmish.yaml").write_text("# @package _global_\nhorizon: 99\n")
    assert compose_config("train", ["wind=calm"]).horizon == 99
    (tmp_path / "conf" / "wind" / "calm.yaml").unlink()
    with pytest.raises(ConfigError, match="wind must be one of"):
        compose_config("train", ["wind=calm"])


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        each
        for each in [
            ([], []),
            (["scenario=large", "reward=time", "n_worlds=3"], []),
            (["team.n_agents=4", "wind.speed=10"], ["wind.speed=10", "team.n_agents=4"]),
            (["team.roles=[uav,ugv]", "fire=hazard"], ["fire.refinement=24", "team.roles=['uav','ugv']"]),
            (["landscape=raster", "landscape.path=/tmp/land", "horizon=9"], ["landscape=raster", "horizon=9"]),
            (
                ["landscape=raster", "landscape.table={11:3,98:0}"],
                ["landscape=raster", "landscape.table.11=3", "landscape.table.98=0"],
            ),
            (["action_masking=false"], ["action_masking=False"]),
            (["scenario=search", "model.messages=graph", "mechanics.radio.loss=0.0"], ["mechanics.radio.loss=0.0"]),
            (
                ["scenario=search", "model.messages=both", "mechanics.radio.loss=0.0"],
                ["mechanics.radio.carries=map", "mechanics.radio.loss=0.0"],
            ),
            (["wind=calm", "fire=paper", "fire.beta=0.5"], ["wind=calm", "fire=paper", "fire.beta=0.5"]),
            (["fire=spread", "steps_per_tick=4"], ["fire=spread", "steps_per_tick=4"]),
        ]
        if can_play(each[0])
    ],
)
def test_worlds_are_told_by_what_differs_from_their_scenario(overrides, expected):
    assert world_overrides(plain(compose_config("train", overrides))) == expected


def test_only_training_asks_for_a_compiler(monkeypatch):
    def none() -> str:
        raise InvalidCxxCompiler

    monkeypatch.setattr("torch._inductor.cpp_builder.get_cpp_compiler", none)
    plan = run_config(plain(compose_config("train", ["compile=true"])))
    with pytest.raises(ConfigError, match="compile must be false here"):
        plan.check_training()
    assert plan.make_env(1, 0).reset()["done"].shape == (1, 1)  # what was trained elsewhere is played here
    run_config(plain(compose_config("train", []))).check_training()


@pytest.mark.parametrize("hold", [lambda text: {"path": text}, lambda text: {text: 1}, lambda text: [[text]]])
def test_a_record_has_texts_as_long_as_a_path_and_no_longer(hold):
    longest, longer = ({"choices": {}, "values": {"a": hold("a" * length)}} for length in (4096, 4097))
    assert read_saved_config(longest).values == longest["values"]
    with pytest.raises(ValueError, match="texts must have at most 4096 characters"):
        read_saved_config(longer)
