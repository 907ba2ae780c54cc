"""What is searched is read in the grammar of Hydra's sweeps."""

import pytest

from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.space import Dimension, dimension, divided


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("interval(0.9, 1)", {"low": 0.9, "high": 1.0}),
        ("tag(log, interval(1e-4, 3e-3))", {"low": 1e-4, "high": 3e-3, "log": True}),
        ("int(interval(1, 8))", {"low": 1, "high": 8, "is_whole": True}),
        ("tag(log, int(interval(4, 64)))", {"low": 4, "high": 64, "is_whole": True, "log": True}),
        ("range(1, 9, 3)", {"low": 1, "high": 7, "step": 3, "is_whole": True}),  # 1, 4, 7: without its stop
        ("range(3)", {"low": 0, "high": 2, "step": 1, "is_whole": True}),
        ("range(0.5, 1.5, 0.5)", {"low": 0.5, "high": 1.0, "step": 0.5}),
        ("choice(tanh, relu)", {"choices": ("tanh", "relu")}),
        ("0.98,0.99", {"choices": ("0.98", "0.99")}),
        ("true,null,'a b'", {"choices": ("True", "null", "'a b'")}),
        ("[64,64],[128]", {"choices": ("[64,64]", "[128]")}),
    ],
)
def test_a_key_is_searched_as_hydra_sweeps_over_it(text, expected):
    assert dimension(f"a.b={text}") == Dimension(key="a.b", text=text, **expected)


@pytest.mark.parametrize("override", ["a=1", "a=[1,2]", "a='1,2'", "a=null", "scenario=single"])
def test_a_key_with_one_value_is_not_searched(override):
    assert dimension(override) is None


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("interval(2, 1)", "a must have two values at least, from low to high, got interval(2, 1)"),
        ("interval(1, inf)", "a must be searched between finite numbers, got interval(1, inf)"),
        ("range(1, 2)", "a must have two values at least, from low to high, got range(1, 2)"),
        ("choice(1)", "a must have two values at least, from low to high, got choice(1)"),
        ("1,2,1", "a must have each choice once, got 1,2,1"),
        (
            "tag(log, interval(0, 1))",
            "a must be in an interval above 0 to be searched by logarithm, got tag(log, inter",
        ),
        ("tag(log, choice(1, 2))", "a must be in an interval above 0 to be searched by logarithm, got tag(log, choic"),
        ("tag(log, range(1.0, 9.0, 1.0))", "a must be in an interval above 0 to be searched by logarithm, got tag"),
        ("glob(*)", "a must be an interval, a range or choices to be searched, got glob(*)"),
    ],
)
def test_what_cannot_be_searched_is_told_in_one_line(text, line):
    with pytest.raises(ConfigError) as error:
        dimension(f"a={text}")
    assert str(error.value).startswith(line)


@pytest.mark.parametrize(
    ("text", "value", "held"),
    [
        ("interval(0, 1)", 0.5, 0.5),
        ("interval(0, 1)", 1, 1.0),
        ("interval(0, 1)", 1.5, None),
        ("interval(0, 1)", True, None),
        ("int(interval(0, 9))", 3, 3),
        ("int(interval(0, 9))", 3.5, None),
        ("range(1, 9, 3)", 4, 4),
        ("range(1, 9, 3)", 5, None),
        ("true,false", False, "False"),
        ("0,2", False, None),
        ("null,64", None, "null"),
        ("[64,64],[128]", [128], "[128]"),
        ("relu,tanh", "elu", None),
    ],
)
def test_a_configuration_s_value_is_one_of_the_space_or_none(text, value, held):
    found = dimension(f"a={text}").holding(value)
    assert found == held and type(found) is type(held)


def test_the_command_line_goes_before_a_ready_search():
    space, fixed = divided(
        ["algorithm=mappo", "a=0.5", "b=range(3)", "d=1,2"],
        {"a": "interval(0,1)", "b": "interval(5,6)", "c": "interval(7, 8)"},
        ["algorithm=ppo", "seed=3"],
    )
    assert {each.key: each.text for each in space} == {"c": "interval(7, 8)", "b": "range(3)", "d": "1,2"}
    assert fixed == ["seed=3", "algorithm=mappo", "a=0.5"]


def test_what_is_not_of_the_grammar_is_told_with_its_key():
    with pytest.raises(ConfigError, match=r"a=interval\(1 cannot be read"):
        divided([], {"a": "interval(1"}, [])
