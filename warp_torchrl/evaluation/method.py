"""Names of trained policies in tables, from their configuration."""

import json
from collections.abc import Mapping
from hashlib import sha256
from typing import Any

from warp_torchrl.runs.config.compose import option_values
from warp_torchrl.runs.config.saved_config import SavedConfig

_NOT_TRAINED_BY = ("seed", "device", "evaluation", "checkpoint")


def method(saved_config: SavedConfig) -> tuple[str, str]:
    """Return a trained policy's name in tables, and a digest of its configuration without the seed.

    Runs of several versions are alike by it if their records are ``completed``.
    """
    names = [saved_config.choices[group] for group in ("algorithm", "reward", "observation")]
    names += [*unusual(saved_config), *teacher_label(saved_config)]
    values = {key: value for key, value in saved_config.values.items() if key not in _NOT_TRAINED_BY}
    return " ".join(names), sha256(json.dumps(_with_floats(values), sort_keys=True).encode()).hexdigest()


_USUAL = {
    ("model", "sharing"): "team",
    ("model", "symmetry"): "canonical",
    ("model", "memory"): 0,
    ("model", "messages"): "none",
    ("model", "trust"): 0.0,
    ("reward", "barrier_rule"): "cut_off",
    ("reward", "cooperation"): 0.0,
}
"""Values that a policy's name leaves out, beside those of an observation that its option has."""
_SEEN = ("radius", "advice", "near", "rules", "water", "ways", "features")
"""Keys of an observation that a policy's name shows."""


def unusual(saved_config: SavedConfig) -> list[str]:
    """Return a policy's unusual settings, and the curriculum and the mixture if it had one, as overrides."""
    seen = saved_config.values.get("observation", {})
    option = option_values("observation", saved_config.choices["observation"]) or seen
    usual = {("observation", key): option.get(key) for key in _SEEN} | _USUAL
    found = {(group, key): saved_config.values.get(group, {}).get(key) for group, key in usual}
    settings = {key: value for (group, key), value in found.items() if value not in (None, usual[group, key])}
    groups = {group: saved_config.choices.get(group, "none") for group in ("curriculum", "mixture")}
    settings |= {group: choice for group, choice in groups.items() if choice != "none"}
    return [f"{key}={_written(value)}" for key, value in settings.items()]


def _written(value: Any) -> str:
    """Return a value as in an override, 1 and 1.0 alike."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{','.join(map(str, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def teacher_label(saved_config: SavedConfig) -> list[str]:
    """Return the part of a policy's name that lists its teachers besides rewards; empty without any."""
    imitation = saved_config.values.get("imitation", {})
    people = ["people"] if imitation.get("demonstrations") else []
    taught = [imitation["teacher"]] if imitation.get("teacher") else []
    guided = [f"guided by {imitation['guide']}"] if imitation.get("guide") else []
    return guided + ([f"taught by {' and '.join([*taught, *people])}"] if taught or people else [])


def _with_floats(node: Any) -> Any:
    """Return plain values with integers as floats, so that 0 and 0.0 have the same digest."""
    if isinstance(node, Mapping):
        return {key: _with_floats(value) for key, value in node.items()}
    if isinstance(node, list):
        return [_with_floats(value) for value in node]
    return float(node) if isinstance(node, int) and not isinstance(node, bool) else node
