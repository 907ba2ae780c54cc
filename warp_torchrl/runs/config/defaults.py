"""Default values, which stand once, in the dataclasses: a yaml file holds what differs from its class's."""

from collections.abc import Collection, Mapping
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, cast

import omegaconf
from omegaconf import DictConfig, OmegaConf

from warp_torchrl.runs.config.construction import component, free_mappings
from warp_torchrl.system.excerpt import is_stand_in

UNKNOWN = omegaconf.MISSING
"""What stands for a default that is not known yet."""


def defaults(kind: type, left_out: Collection[str] = ()) -> dict[str, Any]:
    """Return the default values of a dataclass's fields as plain values; a field without one is left out.

    Args:
        kind: The dataclass.
        left_out: Further fields that are left out.
    """
    found = {}
    for each in (each for each in fields(kind) if each.init and each.name not in left_out):
        if each.default_factory is not MISSING:
            made = cast("Any", each.default_factory)
            found[each.name] = defaults(cast("type", made)) if is_dataclass(made) else _plain(made())
        elif each.default is not MISSING:
            found[each.name] = _plain(each.default)
    return found


def _plain(value: Any) -> Any:
    if is_stand_in(value):
        return UNKNOWN
    if is_dataclass(value) and not isinstance(value, type):
        return defaults(type(value))
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    return [_plain(each) for each in value] if isinstance(value, tuple | list) else value


def option_node(kind: type) -> DictConfig:
    """Return what a yaml file holds that names a class and nothing else, with every field of the class."""
    node = OmegaConf.create({"_target_": f"{kind.__module__}.{kind.__qualname__}", **defaults(kind)})
    open_mappings(node)
    return node


def open_mappings(node: DictConfig) -> None:
    """Let an override put keys of its own into fields that are mappings of any keys: ``reward.terms.front=0.1``."""
    kind = component(node.get("_target_"))
    mappings = set() if kind is None else free_mappings(kind)
    own = (key for key in node if isinstance(key, str) and key != "hydra")  # whose classes are no components
    keys = [key for key in own if not OmegaConf.is_missing(node, key)]
    for key in (each for each in keys if not OmegaConf.is_interpolation(node, each)):
        part = node[key]
        if isinstance(part, DictConfig):
            is_open = key in mappings or not part or key == "mechanics"
            OmegaConf.set_struct(part, False if is_open else None)
            if not is_open:
                open_mappings(part)
