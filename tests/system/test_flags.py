"""A mistake in flags is one line."""

from pathlib import Path

import pytest

from warp_torchrl.system.flags import FlagParser, file_to_write, listed, whole


def test_a_mistake_in_flags_is_one_line_and_the_exit_code_of_a_mistake(capsys):
    parser = FlagParser(prog="x")
    parser.add_argument("--seed", type=int)
    with pytest.raises(SystemExit) as end:
        parser.parse_args(["--seed", "one"])
    assert end.value.code == 2 and capsys.readouterr().err == "error: seed: invalid int value: 'one'\n"


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
    assert "repeats: must be a whole number in 1..11, got" in capsys.readouterr().err


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
    told = f"error: plot: must be a file in a folder that can be written to, got {given}"
    assert capsys.readouterr().err == f"{told}\n".replace(" \n", "\n")


# Keys


def parser():
    made = FlagParser(prog="x")
    made.add_argument("runs", nargs="*", metavar="RUN")
    made.add_argument("--out")
    made.add_argument("--marl-eval", type=Path)
    made.add_argument("--show", nargs="+")
    made.add_argument("--reach", type=lambda text: [float(each) for each in text.split(",")])
    made.add_argument("--kinds", action="store_true")
    return made


def test_a_key_is_a_flag():
    keys = parser().parse_args(["show=[a,b]", "one", "marl_eval=x=1.json", "kinds=true", "reach=[1,2]", "two"])
    flags = ["one", "two", "--show", "a", "b", "--marl-eval", "x=1.json", "--kinds", "--reach", "1,2"]
    assert keys == parser().parse_args(flags)
    assert keys.runs == ["one", "two"] and keys.show == ["a", "b"] and keys.reach == [1.0, 2.0]


def test_what_has_a_sign_and_is_no_key_stays_as_it_is():
    assert parser().parse_args(["mine=runs/1", "kinds=false"]).runs == ["mine=runs/1"]
    assert parser().parse_args(["--out", "x", "out=y"]).runs == ["out=y"], "beside flags nothing is read as a key"


@pytest.mark.parametrize(
    ("value", "entries"),
    [
        ("a", ["a"]),
        ("[a, b]", ["a", "b"]),
        ("[team.roles=[scout,ugv],horizon=3]", ["team.roles=[scout,ugv]", "horizon=3"]),
    ],
)
def test_a_list_may_hold_lists(value, entries):
    assert listed(value) == entries


def test_a_switch_is_true_or_false(capsys):
    with pytest.raises(SystemExit):
        parser().parse_args(["kinds=yes"])
    assert capsys.readouterr().err == "error: kinds must be true or false, got yes\n"


def test_help_shows_keys(capsys):
    with pytest.raises(SystemExit) as end:
        parser().parse_args(["--help"])
    told = capsys.readouterr().out
    assert end.value.code == 0 and told.startswith("usage: x [RUN ...] [KEY=VALUE ...]\n")
    assert (
        "  marl_eval=VALUE" in told
        and "  show=[VALUE,...]" in told
        and "  kinds=true" in told
        and "--kinds" not in told
    )
