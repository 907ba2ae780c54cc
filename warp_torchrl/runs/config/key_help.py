"""Keys with their defaults, meanings and ranges, read from the dataclasses."""

import ast
import inspect
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from textwrap import dedent, fill
from typing import Any, NamedTuple, get_type_hints

_WIDTH = 100  # characters of a line of help


class Key(NamedTuple):
    """A key of the configuration.

    Attributes:
        name: With the names of its groups, and dots.
        default: As it would be given; empty where it has none.
        words: What it means, with its unit and its range.
    """

    name: str
    default: str
    words: str


def keys(kind: type, prefix: str = "", left_out: Collection[str] = ()) -> Iterator[Key]:
    """Yield each value of a dataclass, and of the dataclasses in it."""
    words, ranges, hints = attributes(kind), bounds(kind), get_type_hints(kind)
    for each in fields(kind):
        if not each.init or each.name in left_out:
            continue
        hint = hints[each.name]
        if isinstance(hint, type) and is_dataclass(hint) and not inspect.isabstract(hint):
            yield from keys(hint, f"{prefix}{each.name}.")
        else:
            within = f" In {ranges[each.name]}." if each.name in ranges else ""
            yield Key(f"{prefix}{each.name}", _default(each), words.get(each.name, "") + within)


def key_help(
    kind: type, prefix: str = "", left_out: Collection[str] = (), values: Mapping[str, Any] | None = None
) -> str:
    """Return the lines of ``--help`` about the keys of a dataclass.

    Args:
        kind: The dataclass.
        prefix: What stands before the names of its fields.
        left_out: Fields that are not shown.
        values: A configuration whose values are shown; the default of a key that it lacks is.
    """
    lines = []
    for key in keys(kind, prefix, left_out):
        value = _at({} if values is None else values, key.name.split("."), key.default)
        lines.append(f"  {key.name}={value}")
        lines.append(fill(key.words.replace("`", ""), _WIDTH, initial_indent="      ", subsequent_indent="      "))
    return "\n".join(lines)


def _at(values: Mapping[str, Any], path: Sequence[str], default: str) -> str:
    for name in path:
        if not isinstance(values, Mapping) or name not in values:
            return default
        values = values[name]
    return shown(values)


def first_paragraph(kind: type) -> str:
    """Return the first paragraph of a class's docstring, in one line."""
    return _code(inspect.cleandoc(kind.__doc__ or "").partition("\n\n")[0].replace("\n", " "))


def shown(value: Any) -> str:
    """Return a value as it would be given on the command line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {shown(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(shown, value)) + "]"
    if isinstance(value, bool) or value is None:
        return "null" if value is None else str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


def _default(each: "Field[Any]") -> str:
    value = each.default if each.default_factory is MISSING else each.default_factory()
    return "" if value is MISSING else shown(value)


def _code(words: str) -> str:
    return words.replace("``", "`")


@cache
def attributes(kind: type) -> Mapping[str, str]:
    """Return what the docstrings of a class and its bases say of each attribute."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        section = inspect.cleandoc(base.__doc__ or "").partition("Attributes:\n")[2]
        section = re.split(r"(?m)^\S", section)[0]
        for name, words in re.findall(r"(?ms)^ {4}(\w+): (.*?)(?=^ {4}\w|\Z)", section):
            found[name] = re.sub(r"`?\bNone\b`?", "`null`", _code(" ".join(words.split())))
    return found


@cache
def bounds(kind: type) -> Mapping[str, str]:
    """Return the ranges that a class and its bases check their fields against."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        check = base.__dict__.get("__post_init__")
        if not inspect.isfunction(check):
            continue
        for node in ast.walk(ast.parse(dedent(inspect.getsource(check)))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "check_fields":
                ends = {each.arg: each.value for each in node.keywords if isinstance(each.value, ast.Tuple)}
                named = check.__globals__
                found |= {
                    str(name): " .. ".join(_bound(each, named) for each in pair.elts) for name, pair in ends.items()
                }
    return found


def _bound(node: ast.expr, named: Mapping[str, Any]) -> str:
    if isinstance(node, ast.Name) and node.id in named:
        return shown(named[node.id])
    try:
        return shown(ast.literal_eval(node))
    except ValueError:
        return ast.unparse(node)
