"""What is told of keys: their words, their values and the ranges that the code checks."""

from dataclasses import dataclass, field

from warp_torchrl.runs.config.key_help import Key, first_paragraph, key_help, keys
from warp_torchrl.validation import check_fields

MOST = 7


@dataclass(frozen=True)
class Inner:
    """Inside.

    Attributes:
        depth: How deep [m].
    """

    depth: float = 0.5

    def __post_init__(self) -> None:
        check_fields(self, depth=(0.0, 2.5))


@dataclass(frozen=True)
class Outer:
    """Outside,
    in two lines.

    More of it.

    Attributes:
        name: ``None`` is nobody
            at all.
        count: How many.
        inner: What is inside.

    Raises:
        ValueError: If a value is out of its range.
    """

    name: str | None
    count: int = 3
    inner: Inner = field(default_factory=Inner)

    def __post_init__(self) -> None:
        check_fields(self, count=(1, MOST))


def test_a_key_has_its_default_its_words_and_the_range_that_is_checked():
    assert list(keys(Outer, "outer.")) == [
        Key("outer.name", "", "`null` is nobody at all."),
        Key("outer.count", "3", "How many. In 1 .. 7."),
        Key("outer.inner.depth", "0.5", "How deep [m]. In 0 .. 2.5."),
    ]
    assert first_paragraph(Outer) == "Outside, in two lines."


def test_help_shows_the_values_of_a_configuration():
    told = key_help(Outer, "outer.", ("name",), {"outer": {"count": 5, "inner": {}}}).splitlines()
    assert told == [
        "  outer.count=5",
        "      How many. In 1 .. 7.",
        "  outer.inner.depth=0.5",
        "      How deep [m]. In 0 .. 2.5.",
    ]
