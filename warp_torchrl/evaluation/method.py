"""What a trained policy is called beside others, from how it was trained."""

import json
from collections.abc import Mapping
from hashlib import sha256
from typing import Any

from warp_torchrl.config.compose import Record

_NOT_TRAINED_BY = ("seed", "device", "evaluation", "checkpoint")


def method(record: Record) -> tuple[str, str]:
    """Return what a trained policy is called in a sweep, and a digest of what it was trained by but for the seed."""
    names = [record.choices[group] for group in ("algorithm", "reward", "observation")]
    names += [*unusual(record), *taught(record)]
    values = {key: value for key, value in record.values.items() if key not in _NOT_TRAINED_BY}
    return " ".join(names), sha256(json.dumps(_with_floats(values), sort_keys=True).encode()).hexdigest()


_USUAL = {
    ("model", "sharing"): "team",
    ("model", "symmetry"): "canonical",
    ("model", "memory"): 0,
    ("observation", "radius"): 5,
    ("reward", "barrier_rule"): "cut_off",
}
"""What a policy's name does not tell, since most have it."""
_PAPERS_RADIUS = 3


def unusual(record: Record) -> list[str]:
    """Return what is unusual in how a policy was trained, as its overrides have it."""
    usual = _USUAL | ({("observation", "radius"): _PAPERS_RADIUS} if record.choices["observation"] == "paper" else {})
    found = {(group, key): record.values.get(group, {}).get(key) for group, key in usual}
    return [f"{key[1]}={value}" for key, value in found.items() if value is not None and value != usual[key]]


def taught(record: Record) -> list[str]:
    """Return how a policy that had a teacher must be called, in one piece; none where it had none."""
    teacher = record.values.get("imitation", {}).get("teacher")
    return [f"taught by {teacher}"] if teacher else []


def _with_floats(node: Any) -> Any:
    """Return plain values with every number as a float: 0 and 0.0 say the same."""
    if isinstance(node, Mapping):
        return {key: _with_floats(value) for key, value in node.items()}
    if isinstance(node, list):
        return [_with_floats(value) for value in node]
    return float(node) if isinstance(node, int) and not isinstance(node, bool) else node
