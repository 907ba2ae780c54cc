"""Text files of cells in the encodings and with the separators that people have."""

import pytest

from warp_torchrl.system.delimited import named_separator, read_table_text, split_rows, to_number, to_points

TEXT = "Temp (°C);WS\n8,5;3\n"


@pytest.mark.parametrize(
    "content",
    [
        TEXT.encode(),
        TEXT.encode("utf-8-sig"),
        TEXT.encode("utf-16"),
        TEXT.encode("utf-16-le"),
        ("\ufeff" + TEXT).encode("utf-16-be"),
        TEXT.encode("latin-1"),
    ],
    ids=["UTF-8", "with a mark", "UTF-16", "UTF-16 without a mark", "UTF-16, big end first", "Latin-1"],
)
def test_a_text_is_the_same_in_every_encoding(tmp_path, content):
    (tmp_path / "a.csv").write_bytes(content)
    assert read_table_text("weather", tmp_path / "a.csv") == TEXT


@pytest.mark.parametrize(
    ("content", "why"),
    [(b"WS\n3\x00\n", "it has NUL bytes"), (b"WS\n\x81\n", "it is no text in UTF-8"), (None, "No such file")],
)
def test_what_is_no_text_is_refused(tmp_path, content, why):
    if content is not None:
        (tmp_path / "a.csv").write_bytes(content)
    with pytest.raises(ValueError, match=rf"^weather must be a CSV file that can be read, got .*a\.csv: {why}"):
        read_table_text("weather", tmp_path / "a.csv")


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(ValueError, match="must be a CSV file that can be read"):
        read_table_text("weather", tmp_path)


def test_excel_names_its_separator_in_the_first_line():
    for first in ("sep=;", '"sep=;"', "SEP=;\r"):
        assert named_separator(f"{first}\na;b\n") == (";", "a;b\n")
    assert named_separator("sep=\t\na\tb") == ("\t", "a\tb")
    assert named_separator("sep,b\n1,2") == (None, "sep,b\n1,2")


@pytest.mark.parametrize("text", ["a, b\r\n1, 2\r\n", "a,b\r1,2\r", '"a","b"\n"1","2"\n'])
def test_lines_end_in_any_way_and_cells_may_stand_in_quotes(text):
    assert split_rows(text, ",") == [["a", "b"], ["1", "2"]]


def test_what_a_terminal_would_obey_is_a_space():
    assert split_rows("WS\x1b[31m,WD\n", ",") == [["WS [31m", "WD"]]


def test_a_space_stands_for_any_number_of_them():
    assert split_rows("a  b\n 1   2 \n\n", " ") == [["a", "b"], ["1", "2"], []]


def test_quotes_that_do_not_close_and_lines_without_end_are_refused():
    with pytest.raises(ValueError, match=r"rows must be cells of a CSV file, .* in line 2"):
        split_rows('a,b\n"1,2\n', ",")
    with pytest.raises(ValueError, match="rows must have 1000 cells at most, got 1001 in line 1"):
        split_rows("," * 1000, ",")


@pytest.mark.parametrize(
    ("cells", "separator", "numbers"),
    [
        (["8,5", "9"], ";", [8.5, 9]),
        (["1,250"], ";", [1.25]),
        ([",5", "-1,25"], "\t", [0.5, -1.25]),
        (["8,5"], ",", [8.5]),  # in quotes
        (["8.5", "\N{MINUS SIGN}2"], ",", [8.5, -2]),
    ],
)
def test_a_comma_is_a_decimal_sign_where_it_can_be_no_other(cells, separator, numbers):
    assert [to_number(cell) for cell in to_points("DC", cells, separator)] == numbers


@pytest.mark.parametrize(
    ("cells", "separator", "words"),
    [
        (["8,5", "8.5"], ";", "DC must have one decimal sign, got '8,5' and '8.5'"),
        (["1,250", "900"], ",", "DC must have decimal points, '1,250' may be thousands"),
        (["1,250"], "\t", "DC must have decimal points, '1,250' may be thousands"),
    ],
)
def test_commas_that_may_be_thousands_are_refused(cells, separator, words):
    with pytest.raises(ValueError) as refusal:
        to_points("DC", cells, separator)
    assert str(refusal.value) == words


def test_only_plain_numbers_are_numbers():
    assert [to_number(cell) for cell in ("5", "-.5", "+2.", "1e3")] == [5, -0.5, 2, 1000]
    assert {to_number(cell) for cell in ("", "1_0", "inf", "nan", "1e9999", "0x1", "٣", "1 0", "8,5")} == {None}
