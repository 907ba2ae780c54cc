"""Configurations as plain values and as text."""

from collections.abc import Iterator, Mapping
from typing import Any, cast

from omegaconf import DictConfig, OmegaConf


def plain(config: DictConfig) -> dict[str, Any]:
    """Return a configuration as plain, resolved values."""
    return cast("dict[str, Any]", OmegaConf.to_container(config, resolve=True))


def as_yaml(config: DictConfig) -> str:
    """Return a configuration as the text of a yaml file, with resolved values."""
    return OmegaConf.to_yaml(config, resolve=True)


def without_targets(node: Any) -> Any:
    """Return a configuration node without its ``_target_`` entries."""
    if isinstance(node, Mapping):
        return {key: without_targets(value) for key, value in node.items() if key != "_target_"}
    return list(node) if isinstance(node, list) else node


def keys_of(node: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    """Yield the keys of a configuration, those of groups included."""
    for key, value in node.items():
        if key != "_target_":
            yield f"{prefix}{key}"
        if isinstance(value, Mapping):
            yield from keys_of(value, f"{prefix}{key}.")
