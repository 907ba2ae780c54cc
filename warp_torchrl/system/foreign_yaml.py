"""Untrusted YAML files: plain values, each key once, no aliases, no tags, finite numbers.

A few lines of aliases stand for gigabytes, a tag names a type of Python's, and of a key that is there twice a reader
takes one without a word.
"""

from collections.abc import Iterator
from datetime import date
from math import isfinite
from pathlib import Path
from typing import Any

import yaml

from warp_torchrl.system.foreign import Foreign, read_text

LARGEST_YAML = 1_000_000
"""Size that a file may have [bytes]."""
_DEEPEST = 30
_MOST_PARTS = 50_000
_PLAIN = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # in C ten times as fast
_WORDS = getattr(yaml, "CBaseLoader", yaml.BaseLoader)


def read_yaml(path: Path, most: int = LARGEST_YAML) -> Any:
    """Return what a YAML file holds as plain values; None if it is empty.

    Args:
        path: The file.
        most: Size that it may have [bytes].

    Raises:
        Foreign: If it is no YAML that is read; the message names the file and the line.
        OSError: If it cannot be opened.
    """
    return _read(path, most, _PLAIN)


def read_words(path: Path, most: int = LARGEST_YAML) -> Any:
    """Return what a YAML file holds with every number and word as the text that stands there, as of ``read_yaml``."""
    return _read(path, most, _WORDS)


def _read(path: Path, most: int, loader: Any) -> Any:
    text = read_text(path, most)
    try:
        _check_events(text)
        _check_keys(yaml.compose(text, Loader=loader))
        content = yaml.load(text, Loader=loader)
        _check_values(content)
    except (yaml.YAMLError, ValueError, OverflowError, RecursionError) as error:
        raise Foreign(f"{path} is no YAML that is read: {' '.join(str(error).split())}") from None
    return content


def _check_events(text: str) -> None:
    """Check that a text has no alias and no tag, and is neither nested too deep nor too long.

    Raises:
        ValueError: If it has.
        yaml.YAMLError: If it is no YAML.
    """
    depth = 0
    for number, event in enumerate(yaml.parse(text, Loader=_PLAIN)):
        line = f"line {event.start_mark.line + 1}"
        if isinstance(event, yaml.AliasEvent):
            raise ValueError(f"{line} has an alias, *{event.anchor:.40}: write out what it stands for")
        if isinstance(event, yaml.NodeEvent) and getattr(event, "tag", None) is not None:
            raise ValueError(f"{line} has a tag, {event.tag:.60}")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > _DEEPEST:
            raise ValueError(f"{line} is nested more than {_DEEPEST} deep")
        if number > 2 * _MOST_PARTS:
            raise ValueError(f"it has more than {_MOST_PARTS} values")


def _check_keys(node: yaml.Node | None) -> None:
    """Check that each mapping has each key once, and no key that is a mapping or merges one.

    Raises:
        ValueError: If one has.
    """
    for mapping in (each for each in _nodes(node) if isinstance(each, yaml.MappingNode)):
        seen = set()
        for key, _ in mapping.value:
            line = f"line {key.start_mark.line + 1}"
            if not isinstance(key, yaml.ScalarNode) or key.value == "<<":
                raise ValueError(f"{line} has a key that is no text or number")
            if (key.tag, key.value) in seen:
                raise ValueError(f"{line} has the key {key.value[:60]} once more")
            seen.add((key.tag, key.value))


def _nodes(node: yaml.Node | None) -> Iterator[yaml.Node]:
    left = [] if node is None else [node]
    while left:
        node = left.pop()
        yield node
        if isinstance(node, yaml.SequenceNode):
            left += node.value
        elif isinstance(node, yaml.MappingNode):
            left += [part for pair in node.value for part in pair]


def _check_values(content: Any) -> None:
    """Check that values are plain, and numbers finite.

    Raises:
        ValueError: If one is not.
    """
    left = [content]
    while left:
        value = left.pop()
        if isinstance(value, dict):
            left += [*value, *value.values()]
        elif isinstance(value, list):
            left += value
        elif not isinstance(value, str | int | float | date | None):
            raise ValueError(f"{type(value).__name__} is no kind of value that is read")
        elif isinstance(value, float) and not isfinite(value):
            raise ValueError(f"numbers must be finite, got {value}")
