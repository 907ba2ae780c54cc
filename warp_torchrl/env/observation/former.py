"""Entries of saved files of former versions: renamed ones, and a ``status`` without names."""

import re
from collections.abc import Mapping
from typing import Any

from warp_torchrl.env.observation.critic import CriticState
from warp_torchrl.env.observation.status import STATUS
from warp_torchrl.world.world import World

_SELF = re.compile(r"(^|[./])((?:canonical_(?:sent_)?)?)self(?=$|[./])")
"""``status`` was once called ``self``, also where it lies in canonical orientation, or late with the radio."""


FORMER_STATUS = tuple(
    part
    for name in ("place", "clock", "wind", "next_tick", "tank", "has_tank", "may_refill", "role", "last_action")
    for part in STATUS[name].parts(World())
)
"""Numbers of ``status`` in manifests that do not name them."""
FORMER_STATUS_AND_IDENTITY = (*FORMER_STATUS, *STATUS["identity"].parts(World()))
"""The same of teams that are told their places."""

FORMER_STATE = CriticState(World())
"""What the critic saw."""


def renamed(name: str) -> str:
    """Return the name that an entry has now; parts of a nested entry's name are joined by ``.`` or ``/``."""
    return _SELF.sub(r"\1\2status", name)


def with_renamed(content: Any) -> Any:
    """Return nested mappings and sequences whose mappings have the names of now; all else is as it is."""
    if isinstance(content, Mapping):
        return {renamed(key) if isinstance(key, str) else key: with_renamed(each) for key, each in content.items()}
    if type(content) in (list, tuple):
        return type(content)(map(with_renamed, content))
    return content
