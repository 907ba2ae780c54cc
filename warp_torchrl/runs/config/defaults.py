"""Default values, which stand once, in the dataclasses: a yaml file holds what differs from its class's.

Where Hydra reads a yaml file, in ``conf/`` or in a folder of the user's own, the fields that the file leaves out are
filled in. So ``--cfg job`` shows every value, every field can be overridden, and a key that is no field is refused.
"""

import re
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any, ClassVar, cast

from hydra._internal.core_plugins import file_config_source
from hydra._internal.sources_registry import SourcesRegistry
from hydra.plugins.config_source import ConfigResult
from omegaconf import DictConfig, OmegaConf

from warp_torchrl.runs.config.construction import COMPONENTS, ConfigError, component, free_mappings
from warp_torchrl.runs.config.options import PredictionOptions, SearchOptions
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.system.foreign_yaml import read_yaml
from warp_torchrl.world.world import World

_RESOLVER = re.compile(r"\$\{[^{}]*:")


def defaults(kind: type) -> dict[str, Any]:
    """Return the default values of a dataclass's fields as plain values; a field without one is left out."""
    found = {}
    for each in fields(kind):
        default = each.default if each.default_factory is MISSING else each.default_factory()
        if each.init and default is not MISSING:
            found[each.name] = _plain(default)
    return found


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return defaults(type(value))
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    return [_plain(each) for each in value] if isinstance(value, tuple | list) else value


class FileConfigSource(file_config_source.FileConfigSource):
    """Hydra's source of yaml files, which fills in the fields that a file leaves out.

    It reads and fills each state of a file once: of the time to compose a configuration that was a third. A file that
    ``read_yaml`` refuses is refused, and so is an option of a component that reads the environment or runs a resolver:
    options are handed around, as a calibrated law is.
    """

    _filled: ClassVar[dict[tuple[Path, int], ConfigResult]] = {}

    def load_config(self, config_path: str) -> ConfigResult:
        """Return the content of a yaml file, a command's or an option of a group, with every field of its class."""
        path = Path(self.path, self._normalize_file_name(config_path))
        if not path.is_file():
            return super().load_config(config_path)  # and says that there is none
        state = path, path.stat().st_mtime_ns
        if state not in self._filled:
            self._filled[state] = self._read(config_path)
        return deepcopy(self._filled[state])

    def _read(self, config_path: str) -> ConfigResult:
        path = Path(self.path, self._normalize_file_name(config_path))
        content = read_yaml(path)  # Hydra would follow aliases, and keep NaN
        if config_path.split("/")[0] in COMPONENTS:
            _check_references(path, content)
        result = super().load_config(config_path)
        if isinstance(result.config, DictConfig):
            filled = OmegaConf.merge(_left_out(config_path, result.config), result.config)
            result.config = cast("DictConfig", filled)
            _open_mappings(result.config)
        return result


def _check_references(path: Path, content: Any) -> None:
    """Check that the texts of an option refer to keys of the configuration alone.

    Raises:
        ConfigError: If one does not.
    """
    left = [content]
    while left:
        value = left.pop()
        if isinstance(value, str) and _RESOLVER.search(value):
            raise ConfigError(f"{path} must hold plain values, and references as ${{horizon}} is one, got {value:.80}")
        left += [*value, *value.values()] if isinstance(value, dict) else value if isinstance(value, list) else []


def _open_mappings(node: DictConfig) -> None:
    """Let an override put keys of its own into fields that are mappings of any keys: ``reward.terms.front=0.1``."""
    kind = component(node.get("_target_"))
    mappings = set() if kind is None else free_mappings(kind)
    keys = [key for key in node if isinstance(key, str) and not OmegaConf.is_missing(node, key)]
    for key in (each for each in keys if not OmegaConf.is_interpolation(node, each)):
        part = node[key]
        if isinstance(part, DictConfig):
            is_open = key in mappings or not part or key == "mechanics"
            OmegaConf.set_struct(part, False if is_open else None)
            if not is_open:
                _open_mappings(part)


def _left_out(config_path: str, node: DictConfig) -> dict[str, Any]:
    """Return the default values of what a yaml file configures."""
    name = config_path.removesuffix(".yaml")
    if name == "predict":
        return defaults(PredictionOptions)
    if name == "search":
        return {"search": defaults(SearchOptions)}
    if name == "train":
        run = {**defaults(World), "mechanics": {}, **defaults(RunConfig)}
        return {key: value for key, value in run.items() if key not in COMPONENTS}
    kind = component(node["_target_"]) if "_target_" in node else None
    if kind is None:
        return {}
    # A file that builds on another leaves to that one what its class inherits.
    own = kind.__annotations__ if "defaults" in node else defaults(kind)
    return {"_target_": node["_target_"], **{name: value for name, value in defaults(kind).items() if name in own}}


# Hydra's registry refuses a second source of a scheme, unless both have one name: hence the name and the assignment.
SourcesRegistry.instance().types[FileConfigSource.scheme()] = FileConfigSource
