"""A mistake in flags is one line."""

import pytest

from warp_torchrl.flags import FlagParser


def test_a_mistake_in_flags_is_one_line_and_the_exit_code_of_a_mistake(capsys):
    parser = FlagParser(prog="x")
    parser.add_argument("--seed", type=int)
    with pytest.raises(SystemExit) as end:
        parser.parse_args(["--seed", "one"])
    assert end.value.code == 2 and capsys.readouterr().err == "error: argument --seed: invalid int value: 'one'\n"
