"""Keys of the configuration that had another name, which is read for one release."""

import logging
from collections.abc import Mapping, Sequence
from typing import Any

log = logging.getLogger("warp_torchrl")

RENAMED: dict[str, tuple[str, dict[str, str]]] = {
    "model.facing": ("model.symmetry", {"fire": "canonical", "north": "none"}),
    "team.messages": ("team.radio.carries", {}),
    "team.radio_range": ("team.radio.range", {}),
    "team.radio_loss": ("team.radio.loss", {}),
    "team.radio_line_of_sight": ("team.radio.line_of_sight", {}),
}
"""The new name of each, and of values that have one."""


def renamed_overrides(overrides: Sequence[str]) -> list[str]:
    """Return overrides in Hydra's grammar with the names of now; what was renamed is logged."""
    found = []
    for override in overrides:
        key, equals, value = override.partition("=")
        if key.strip() in RENAMED:
            new, values = RENAMED[key.strip()]
            now = f"{new}{equals}{','.join(values.get(each.strip(), each) for each in value.split(','))}"
            log.warning("%s is now %s; the old name goes with the next release", override, now)
            override = now
        found.append(override)
    return found


def renamed_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a configuration, as a run folder keeps them, with the names of now."""
    return {name: _renamed(name, part) if isinstance(part, Mapping) else part for name, part in values.items()}


def _renamed(group: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a group with the names of now; an old name beside its new one stays, and is refused."""
    now: dict[str, Any] = {}
    for key, value in values.items():
        new, changed = RENAMED.get(f"{group}.{key}", ("", {}))
        part, _, name = new.removeprefix(f"{group}.").partition(".")
        if not new or part in values:
            now[key] = value
            continue
        value_now = changed.get(value, value) if isinstance(value, str) else value
        if name:
            now.setdefault(part, {})[name] = value_now
        else:
            now[part] = value_now
    return now
