"""Text of others on a terminal and on a page: what is shown is what was written, and nothing of it is obeyed."""

import html
import re

import pytest

from warp_torchrl.system.foreign_text import escaped_markdown, plain_text


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ("run-1_b.2", "run-1_b.2"),
        ("Förster, 消防 🔥", "Förster, 消防 🔥"),
        ("\x1b[2J\x1b[31;1mred\x1b[0m", "red"),
        ("\x9b31mred", "red"),
        ("\x1b]0;a title\x07name", "name"),
        ("\x1b]8;;http://evil.example\x1b\\name\x1b]8;;\x1b\\", "name"),
        ("\x1bP$q\x1b\\name\x1bc\x1b(0\x1b", "name"),
        ("one\r\ntwo\tthree\x00\x08\x7f", "one two three"),
        ("next\x85line\u2028 and\u2029 on", "next line and on"),
        ("\u202efdp.exe\u202c \u2066x\u2069 \u200f\u061c", "fdp.exe x"),
        ("zero\u200bwidth\ufeff \U000e0041\ud800\ue000", "zerowidth"),
        ("", ""),
    ],
)
def test_a_terminal_gets_one_line_without_commands(given, told):
    assert plain_text(given, 100) == told
    assert plain_text(told, 100) == told, "what is plain stays as it is"


@pytest.mark.parametrize("most", [1, 3, 10, 300])
def test_a_long_text_is_cut(most):
    assert plain_text("a" * most, most) == "a" * most
    for long in ("a" * (most + 1), "a" * 10_000_000):
        cut = plain_text(long, most)
        assert len(cut) == most and cut.endswith("."), "and says so"
    assert plain_text("\0" * 10_000_000 + "a", most) == "..."[:most]


MARKUP = [
    "<img src=x onerror=alert(1)>",
    "{alert(1)}",
    "export const a = 1",
    "[a](javascript:alert(1))",
    "![a](https://evil.example/x.png)",
    "`code` **bold** _it_ ~~no~~ | cell \\",
    "# heading",
    "1. list",
    "- list",
    "--- | --- rule",
    "a&lt;b \"'",
]


@pytest.mark.parametrize("given", MARKUP)
def test_markup_is_shown_and_not_obeyed(given):
    escaped = escaped_markdown(given)
    assert html.unescape(escaped).replace("\u2060", "") == given, "a reader sees what was written"
    assert escaped.startswith("&#") or escaped[0] == "a", "no list or program begins"
    assert not re.search(r"[^\w ,.-]|\b_|_\b", re.sub(r"&#\d+;", "0", escaped))


@pytest.mark.parametrize(
    "given", ["https://evil.example", "HTTP://evil.example", "www.evil.example", "me@evil.example"]
)
def test_no_address_becomes_a_link(given):
    assert "\u2060" in html.unescape(escaped_markdown(given))


def test_a_plain_name_stays_legible():
    assert escaped_markdown("07 bulldozer_0, run-1.2 of 消防") == "07 bulldozer_0, run-1.2 of 消防"


def test_what_is_no_text_is_shown_and_cut_too():
    assert html.unescape(escaped_markdown(ValueError("\x1b[1mno <b>"))) == "no <b>"
    assert html.unescape(escaped_markdown("<" * 400, 5)) == "<<..."
