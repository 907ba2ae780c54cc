"""What does not fit the command line's grammar is told with what would."""

import shlex

import pytest
from hydra._internal.utils import get_args_parser
from hydra.core.override_parser.overrides_parser import OverridesParser

from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.grammar import FLAGS, check_flags, check_overrides, flags_first, own_values


def test_hydra_has_these_flags_and_no_others():
    assert set(FLAGS) == set(get_args_parser()._option_string_actions)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--total_frames", "1000"], "keys are given as total_frames=1000, without dashes; --total_frames is no flag"),
        (["seed=1", "--total_frames=1000"], "keys are given as total_frames=1000,"),
        (["--total-frames", "1000"], "keys are given as total_frames=1000,"),
        (["-seed", "3"], "keys are given as seed=3,"),
        (["--debug", "seed=3"], "keys are given as debug=VALUE,"),
        (["--multi", "seed=1,2"], "did you mean --multirun?"),
    ],
)
def test_keys_with_dashes_are_told_how_they_are_given(arguments, said):
    with pytest.raises(ConfigError) as error:
        check_flags(arguments)
    assert said in str(error.value) and "\n" not in str(error.value)


def test_flags_of_hydra_s_pass():
    check_flags(["-m", "--cfg", "job", "--config-dir=x", "seed=-1", "--multirun"])


FOLDERS = ["/my maps/a=b", "/tmp/a=b", "/tmp/run (1)", "/tmp/it's (mine)", "/tmp/a#b", "~/maps", "/tmp/été", '/a"b']


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_path_that_cannot_be_read_is_told_how_to_quote_it(folder):
    with pytest.raises(ConfigError) as error:
        check_overrides(["seed=1", f"landscape.path={folder}"])
    told = str(error.value)
    assert told.startswith(f"landscape.path={folder} cannot be read: ") and "\n" not in told
    (typed,) = shlex.split(told.rpartition("quote it, ")[2])  # as a shell takes it
    assert OverridesParser.create().parse_override(typed).value() == folder


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (["landscape.path=/my", "maps"], "quote it, \"landscape.path='/my maps'\""),  # a shell cut it in two
        (["total_frames", "1000"], "total_frames has no value: keys are given as total_frames=1000"),
        (["seed=1", "a.b.=3"], "a.b.=3 cannot be read: token recognition error"),
        (["model.actor_hidden=[16,"], "model.actor_hidden=[16, cannot be read: "),
    ],
)
def test_what_else_cannot_be_read_is_told(overrides, said):
    with pytest.raises(ConfigError) as error:
        check_overrides(overrides)
    assert said in str(error.value) and "\n" not in str(error.value)


def test_what_hydra_reads_passes():
    check_overrides(["a=b c", "~a.b", "+a.b=[1,{x:y}]", "hydra/launcher=joblib", "a='x=y'", "seed=range(3)", "a=1,2"])


def test_a_command_s_own_values_are_read_and_the_others_left_as_they_are():
    given = ["seed=3", "out=1", "error=0.5", "acts=null", "check=true", "host='::1'", "team.n_agents=2", "beside=null"]
    values, rest = own_values(given, ("seed", "out", "error", "acts", "check", "host", "beside"), ("out", "beside"))
    assert values == {
        "seed": 3, "out": "1", "error": 0.5, "acts": None, "check": True, "host": "::1", "beside": None,
    }  # fmt: skip
    assert rest == ("team.n_agents=2",)


def test_several_values_of_a_command_s_own_key_are_refused():
    with pytest.raises(ConfigError, match="seed=1,2 has several values"):
        own_values(["seed=1,2"], ("seed",))


@pytest.mark.parametrize(
    ("given", "ordered"),
    [
        ("seed=1 -m", "-m seed=1"),
        ("seed=1 --config-dir docs experiment=x -m", "--config-dir docs -m seed=1 experiment=x"),
        ("seed=1 --config-dir=docs", "--config-dir docs seed=1"),
        ("--cfg job seed=1 -p fire", "--cfg job -p fire seed=1"),
        ("--info seed=1", "--info=all seed=1"),
        ("seed=1 -i plugins", "-i=plugins seed=1"),
        ("'a=--cfg' b=2", "'a=--cfg' b=2"),
    ],
)
def test_flags_stand_before_keys_with_their_values(given, ordered):
    assert flags_first(given.split()) == ordered.split()


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ("seed=1 --cfg", "--cfg needs a value of job, hydra, all"),
        ("--cfg seed=1", "--cfg needs a value of job, hydra, all, got seed=1"),
        ("--cfg=jobs", "--cfg needs a value of job, hydra, all, got jobs"),
        ("--config-dir -m", "--config-dir needs a value"),
        ("--info=some", "--info needs a value of all, config"),
    ],
)
def test_a_flag_without_its_value_is_told_in_one_line(given, line):
    with pytest.raises(ConfigError, match=f"^{line}"):
        flags_first(given.split())
