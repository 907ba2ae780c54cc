"""What the commands begin and end with."""

import pytest

from warp_torchrl.commands.program import run_program
from warp_torchrl.config.construction import ConfigError


def test_help_is_printed_and_nothing_is_done(capsys):
    assert run_program(["seed=1", "--help"], "how to use it", lambda given: pytest.fail("it was done")) == 0
    assert capsys.readouterr().out == "how to use it\n"


@pytest.mark.parametrize(("code", "expected"), [(None, 0), (0, 0), (4, 4)])
def test_the_exit_code_is_what_was_done_returned(code, expected):
    assert run_program(["seed=1"], "", lambda given: code) == expected


def test_a_mistake_is_one_line_and_an_exit_code(capsys):
    def do(given):
        raise ConfigError(f"{given[0]} is wrong,\nand this says why")

    assert run_program(["seed=1"], "", do) == 2
    assert capsys.readouterr().err == "error: seed=1 is wrong, and this says why\n"
