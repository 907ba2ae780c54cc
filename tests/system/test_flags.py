"""A mistake in flags is one line."""

from pathlib import Path

import pytest

from warp_torchrl.system.flags import FlagParser, file_to_write, whole


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


@pytest.mark.parametrize("given", ["0", "-3", "nan", "1e3", "12", "9" * 5000, "²"])
def test_a_number_out_of_its_range_is_refused(capsys, given):
    parser = FlagParser(prog="x")
    parser.add_argument("--repeats", type=whole(1, 11))
    assert parser.parse_args(["--repeats", "11"]).repeats == 11
    with pytest.raises(SystemExit) as end:
        parser.parse_args([f"--repeats={given}"])
    assert end.value.code == 2
    assert "argument --repeats: must be a whole number in 1..11, got" in capsys.readouterr().err


def test_a_flag_is_written_in_full(capsys):
    parser = FlagParser(prog="x")
    parser.add_argument("--no-compile", action="store_true")
    with pytest.raises(SystemExit) as end:
        parser.parse_args(["--no"])
    assert end.value.code == 2 and capsys.readouterr().err == "error: unrecognized arguments: --no\n"


@pytest.mark.parametrize("given", [".", "file/x.png", "missing/x.png", ""])
def test_a_file_that_cannot_be_made_is_told_before_its_content_is(tmp_path, monkeypatch, capsys, given):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    parser = FlagParser(prog="x")
    parser.add_argument("--plot", type=file_to_write)
    assert parser.parse_args(["--plot", "x.png"]).plot == Path("x.png")
    with pytest.raises(SystemExit) as end:
        parser.parse_args(["--plot", given])
    assert end.value.code == 2
    told = f"error: argument --plot: must be a file in a folder that can be written to, got {given}"
    assert capsys.readouterr().err == f"{told}\n".replace(" \n", "\n")
