"""A mistake in flags is one line."""

import pytest

from warp_torchrl.flags import FlagParser


def test_a_mistake_in_flags_is_one_line_and_the_exit_code_of_a_mistake(capsys):
    parser = FlagParser(prog="x")
    parser.add_argument("--seed", type=int)
    with pytest.raises(SystemExit) as end:
        parser.parse_args(["--seed", "one"])
    assert end.value.code == 2 and capsys.readouterr().err == "error: argument --seed: invalid int value: 'one'\n"


def test_the_line_holds_nothing_that_a_terminal_obeys_or_cannot_show(capsys):
    with pytest.raises(SystemExit):
        FlagParser(prog="x").error("no \x1b[31mfolder\x1b[0m\nbad\udcff")
    assert capsys.readouterr().err == "error: no folder bad\n"
