"""A value that does not fit is told in the same words from a yaml file and from Python."""

import numpy as np
import pytest

from warp_torchrl.env.reward import Adaptive, Efficiency
from warp_torchrl.models import Mlp
from warp_torchrl.runs.config.construction import ConfigError, construct
from warp_torchrl.runs.config.options import SearchOptions
from warp_torchrl.runs.logging import Wandb
from warp_torchrl.validation import closest_names, did_you_mean, dotted
from warp_torchrl.world.air.wind import Uniform
from warp_torchrl.world.ignition.ignition import Ignition
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import World

BAD = [
    (Uniform, "speed", "fast", "speed must be a number, got 'fast'"),
    (Uniform, "speed", None, "speed must be a number, got None"),
    (Uniform, "speed", True, "speed must be a number, got True"),
    (Uniform, "speed", 10**400, f"speed must be a number, got {10**400}"),
    (SearchOptions, "out", "", "out must be a folder, got ''; null makes one in outputs/searches"),
    (Uniform, "speed", 61.0, "speed must be in [0, 60], got 61.0"),
    (Fire, "growth", 1, "growth must be true or false, got 1"),
    (Fire, "neighbours", 7, "neighbours must be 4 or 8, got 7"),
    (Fire, "kernel", "elipse", "kernel must be alexandridis or ellipse or fbp, got 'elipse': did you mean ellipse?"),
    (Ignition, "count", 1.5, "count must be a whole number, got 1.5"),
    (Perlin, "scale", (1.0, 2.0, 3.0), "scale must be a number or a list of 2 values, got (1.0, 2.0, 3.0)"),
    (Mlp, "actor_hidden", 64, "actor_hidden must be a list of a whole number, got 64"),
    (Wandb, "mode", "onlin", "mode must be offline or online, got 'onlin': did you mean online?"),
    (World, "fire", "paper", "fire must be Automaton, got 'paper'"),
    (RateFire, "moisture", {"dead_1h": "x"}, "moisture.dead_1h must be a number, got 'x'"),
    (Adaptive, "terms", {"front": 2e9}, "terms.front must be in [-1e+09, 1e+09], got 2000000000.0"),
    (Efficiency, "shaping", [], "shaping must be a number, got []"),
]


@pytest.mark.parametrize(("kind", "field", "value", "told"), BAD)
def test_python_and_yaml_are_answered_alike(kind, field, value, told):
    with pytest.raises(ValueError) as direct:
        kind(**{field: value})
    with pytest.raises(ConfigError) as composed:
        construct(kind, {field: value}, "part")
    assert str(direct.value) == told and str(composed.value) == f"part.{told}"


def test_a_value_takes_the_form_of_its_hint():
    made = [Uniform(speed=4).speed, Uniform(speed=np.float32(4.0)).speed, Ignition(count=3.0).count]
    assert made == [4.0, 4.0, 3] and [type(each) for each in made] == [float, float, int]
    assert Mlp(actor_hidden=[16.0]).actor_hidden == (16,) and Perlin(scale=[10, 20]).scale == (10.0, 20.0)
    assert repr(Adaptive(terms={"front": 1}).terms) == "{'front': 1.0}"


# Names


KEYS = ["seed", "scenario", "n_worlds", "reward", "reward.gamma", "algorithm", "algorithm.gamma", "collector.steps"]


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("sede", ["seed"]),
        ("sceanrio", ["scenario"]),
        ("Seed", ["seed"]),
        ("num_worlds", ["n_worlds"]),
        ("algorithm.gama", ["algorithm.gamma"]),  # in its group
        ("steps", ["collector.steps"]),  # without its group
        ("gamma", ["reward.gamma", "algorithm.gamma"]),
        ("algoritm.gamma", ["algorithm.gamma", "reward.gamma"]),  # the whole name tells which comes first
        ("algoritm.gama", ["algorithm.gamma"]),
        ("foo", []),
        ("", []),
    ],
)
def test_the_nearest_key_is_found(name, meant):
    assert closest_names(name, KEYS) == meant


def test_it_ends_a_message():
    assert did_you_mean("gredy", ["greedy", "local"]) == ": did you mean greedy?"
    assert did_you_mean("gamma", KEYS) == ": did you mean reward.gamma or algorithm.gamma?"
    assert did_you_mean(None, KEYS) == did_you_mean("xyz", []) == ""


def test_what_stands_in_mappings_is_found_by_dotted_keys_in_order():
    node = {"fire": {"tau": 5.0, "alpha": [0.1, 0.2]}, "seed": 3, "landscape": {"table": {11: 3}}, "none": {}}
    assert list(dotted(node).items()) == [
        ("fire.tau", 5.0),
        ("fire.alpha", [0.1, 0.2]),
        ("seed", 3),
        ("landscape.table.11", 3),
    ]
    assert dotted({"b": 1}, "a.") == {"a.b": 1}
