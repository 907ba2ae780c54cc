"""Hydra's source of yaml files, with the default values that they leave out.

Where Hydra reads a yaml file, in ``conf/`` or in a folder of the user's own, the fields that the file leaves out are
filled in. So ``--cfg job`` shows every value, every field can be overridden, and a key that is no field is refused.
"""

import re
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any, ClassVar, cast

from hydra._internal.core_plugins import file_config_source
from hydra.plugins.config_source import ConfigResult
from omegaconf import DictConfig, OmegaConf

from warp_torchrl.runs.config.construction import COMPONENTS, ConfigError, component
from warp_torchrl.runs.config.defaults import defaults, open_mappings
from warp_torchrl.system.foreign_yaml import read_yaml

RUN = "warp_torchrl.runs.config.run_config.RunConfig"
"""The class of a run's values; it imports all learners, which worlds do without."""
WORLD = "warp_torchrl.world.world.World"
"""That of a world's."""
PREDICTION = "warp_torchrl.runs.config.options.PredictionOptions"
"""That of a prediction's."""
_SEARCH = "warp_torchrl.runs.config.options.SearchOptions"
_RESOLVER = re.compile(r"\$\{[^{}]*:")


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

    @classmethod
    def forget(cls) -> None:
        """Forget what it has read."""
        cls._filled.clear()

    def _read(self, config_path: str) -> ConfigResult:
        path = Path(self.path, self._normalize_file_name(config_path))
        content = read_yaml(path)  # Hydra would follow aliases, and keep NaN
        if config_path.split("/")[0] in COMPONENTS:
            _check_references(path, content)
        result = super().load_config(config_path)
        if isinstance(result.config, DictConfig):
            filled = OmegaConf.merge(_left_out(config_path, result.config), result.config)
            result.config = cast("DictConfig", filled)
            open_mappings(result.config)
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


def _left_out(config_path: str, node: DictConfig) -> dict[str, Any]:
    """Return the default values of what a yaml file configures."""
    name = config_path.removesuffix(".yaml")
    if name == "predict":
        return _defaults(PREDICTION, left_out=())
    if name == "search":
        return {"search": _defaults(_SEARCH)}
    if name in ("worlds", "train"):
        return {**_defaults(WORLD), "mechanics": {}, **(_defaults(RUN) if name == "train" else {})}
    kind = component(node["_target_"]) if "_target_" in node else None
    if kind is None:
        return {}
    # A file that builds on another leaves to that one what its class inherits.
    own = kind.__annotations__ if "defaults" in node else defaults(kind)
    return {"_target_": node["_target_"], **{name: value for name, value in defaults(kind).items() if name in own}}


def _defaults(target: str, left_out: Sequence[str] = COMPONENTS) -> dict[str, Any]:
    kind = component(target)
    return {} if kind is None else defaults(kind, left_out)
