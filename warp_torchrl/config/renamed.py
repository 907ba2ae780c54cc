"""Keys of the configuration that had another name, which is read for one release."""

import logging
from collections.abc import Mapping, Sequence
from typing import Any

log = logging.getLogger("warp_torchrl")

RENAMED: dict[str, tuple[str, dict[str, str]]] = {
    "model.facing": ("model.symmetry", {"fire": "canonical", "north": "none"}),
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
    now = dict(values)
    for old, (new, changed) in RENAMED.items():
        group, _, key = old.partition(".")
        if isinstance(now.get(group), Mapping) and key in now[group]:
            renamed = {key: new.partition(".")[2]}
            now[group] = {renamed.get(name, name): value for name, value in now[group].items()}
            value = now[group][renamed[key]]
            now[group][renamed[key]] = changed.get(value, value)
    return now
