"""The page of all keys, made of the dataclasses when the site is built: a hook of MkDocs."""

import ast
import inspect
import re
import sys
from collections.abc import Collection, Iterator, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from pathlib import Path
from textwrap import dedent
from typing import Any, get_type_hints

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))  # MkDocs imports this file alone

import yaml  # noqa: E402

from warp_torchrl.runs.config.construction import COMPONENTS, component  # noqa: E402
from warp_torchrl.runs.config.options import PredictionOptions, SearchOptions  # noqa: E402
from warp_torchrl.runs.config.run_config import RunConfig  # noqa: E402
from warp_torchrl.world.mechanics.table import mechanics  # noqa: E402
from warp_torchrl.world.world import World  # noqa: E402

HERE = "<!-- the tables of keys -->"
"""The line of the page that the tables replace."""
_BUILT = {each.name for each in fields(RunConfig) if each.default is each.default_factory is MISSING}
_PARTS = {*_BUILT, *COMPONENTS, "mechanics"}
"""Fields that are components, or made of them, and no values."""


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the tables into the page that has a place for them."""
    return markdown.replace(HERE, tables()) if HERE in markdown else markdown


def tables() -> str:
    """Return the tables of all keys: of the run, of its world, and of each option of each group."""
    parts = ["## The run", _table(RunConfig, _PARTS), "## The world of a scenario", _table(World, _PARTS)]
    for group in COMPONENTS:
        parts += [f"## {group}", *_group(group)]
    parts.append("## mechanics")
    for name, kind in sorted(mechanics().items()):
        parts += [f"### `mechanics.{name}`", _first_line(kind), _table(kind, prefix=f"mechanics.{name}.")]
    parts += ["## warp predict", _table(PredictionOptions), "## warp search", _table(SearchOptions, prefix="search.")]
    return "\n\n".join(parts)


def _group(group: str) -> Iterator[str]:
    """Yield a heading and a table for each class of a group's options."""
    options: dict[type, dict[str, Mapping[str, Any]]] = {}
    for path in sorted((ROOT / "conf" / group).glob("*.yaml")):
        content = yaml.safe_load(path.read_text())
        kind = component(content.pop("_target_", None)) if content else None
        if kind is not None:
            options.setdefault(kind, {})[path.stem] = content
    for kind, names in options.items():
        yield "### " + ", ".join(f"`{group}={name}`" for name in names)
        yield _first_line(kind)
        set_here = {name: values for name, values in names.items() if values and len(names) > 1}
        yield from (f"`{name}` has " + ", ".join(_settings(values)) + "." for name, values in set_here.items())
        yield _table(kind, prefix=f"{group}.")


def _settings(values: Mapping[str, Any]) -> list[str]:
    return [f"`{key}={_shown(value)}`" for key, value in values.items() if key != "defaults"]


def _table(kind: type, left_out: Collection[str] = (), prefix: str = "") -> str:
    rows = [f"| `{key}` | {default} | {words} |" for key, default, words in keys(kind, prefix, left_out)]
    return "\n".join(["| key | default | |", "|---|---|---|", *rows]) if rows else "It has no keys."


def keys(kind: type, prefix: str = "", left_out: Collection[str] = ()) -> Iterator[tuple[str, str, str]]:
    """Yield key, default and words with the range of each value of a dataclass, and of the dataclasses in it."""
    words, ranges, hints = attributes(kind), bounds(kind), get_type_hints(kind)
    for each in fields(kind):
        if not each.init or each.name in left_out:
            continue
        hint = hints[each.name]
        if isinstance(hint, type) and is_dataclass(hint) and not inspect.isabstract(hint):
            yield from keys(hint, f"{prefix}{each.name}.")
        else:
            within = f" In {ranges[each.name]}." if each.name in ranges else ""
            yield f"{prefix}{each.name}", _default(each), words[each.name].replace("|", "\\|") + within


def _default(each: "Field[Any]") -> str:
    value = each.default if each.default_factory is MISSING else each.default_factory()
    return "" if value is MISSING else f"`{_shown(value)}`"


def _shown(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_shown(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_shown, value)) + "]"
    if isinstance(value, bool) or value is None:
        return "null" if value is None else str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


def _first_line(kind: type) -> str:
    return _code(inspect.cleandoc(kind.__doc__ or "").partition("\n\n")[0].replace("\n", " "))


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
            found[name] = re.sub(r"\bNone\b", "`null`", _code(" ".join(words.split())))
    return found


@cache
def bounds(kind: type) -> Mapping[str, str]:
    """Return the ranges that a class and its bases check their fields against."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        check = base.__dict__.get("__post_init__")
        if check is None or not inspect.isfunction(check) or base.__module__.split(".")[0] != "warp_torchrl":
            continue
        for node in ast.walk(ast.parse(dedent(inspect.getsource(check)))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "check_fields":
                ends = {each.arg: each.value for each in node.keywords if isinstance(each.value, ast.Tuple)}
                found |= {str(name): " .. ".join(map(_bound, pair.elts)) for name, pair in ends.items()}
    return found


def _bound(node: ast.expr) -> str:
    try:
        return _shown(ast.literal_eval(node))
    except ValueError:
        return ast.unparse(node)
