"""The page of all keys, made of the dataclasses when the site is built: a hook of MkDocs."""

import sys
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))  # MkDocs imports this file alone

import yaml  # noqa: E402

from warp_torchrl.commands.usage import PARTS  # noqa: E402
from warp_torchrl.runs.config.construction import COMPONENTS, component  # noqa: E402
from warp_torchrl.runs.config.key_help import first_paragraph, keys, shown  # noqa: E402
from warp_torchrl.runs.config.options import PredictionOptions, SearchOptions  # noqa: E402
from warp_torchrl.runs.config.run_config import RunConfig  # noqa: E402
from warp_torchrl.world.mechanics.table import mechanics  # noqa: E402
from warp_torchrl.world.world import World  # noqa: E402

HERE = "<!-- the tables of keys -->"
"""The line of the page that the tables replace."""


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the tables into the page that has a place for them."""
    return markdown.replace(HERE, tables()) if HERE in markdown else markdown


def tables() -> str:
    """Return the tables of all keys: of the run, of its world, and of each option of each group."""
    parts = ["## The run", _table(RunConfig, PARTS), "## The world of a scenario", _table(World, PARTS)]
    for group in COMPONENTS:
        parts += [f"## {group}", *_group(group)]
    parts.append("## mechanics")
    for name, kind in sorted(mechanics().items()):
        parts += [f"### `mechanics.{name}`", first_paragraph(kind), _table(kind, prefix=f"mechanics.{name}.")]
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
        yield first_paragraph(kind)
        set_here = {name: values for name, values in names.items() if values and len(names) > 1}
        yield from (f"`{name}` has " + ", ".join(_settings(values)) + "." for name, values in set_here.items())
        yield _table(kind, prefix=f"{group}.")


def _settings(values: Mapping[str, Any]) -> list[str]:
    return [f"`{key}={shown(value)}`" for key, value in values.items() if key != "defaults"]


def _table(kind: type, left_out: Collection[str] = (), prefix: str = "") -> str:
    rows = [
        f"| `{key.name}` | {f'`{key.default}`' if key.default else ''} | {escaped(key.words)} |"
        for key in keys(kind, prefix, left_out)
    ]
    return "\n".join(["| key | default | |", "|---|---|---|", *rows]) if rows else "It has no keys."


def escaped(words: str) -> str:
    """Return words for a cell of a table."""
    return words.replace("|", "\\|")
