"""Weights as safetensors: a header of names, types and shapes, and the numbers; no pickle."""

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from torch import Tensor

from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.system import foreign
from warp_torchrl.system.checksummed import Unsound, first_line
from warp_torchrl.system.tensors import largest

SAFE_WEIGHTS = "policy.safetensors"
"""Name of the file in a policy's folder."""


def check_safetensors() -> None:
    """Check that safetensors is installed.

    Raises:
        ConfigError: If it is not.
    """
    if find_spec("safetensors") is None:
        raise ConfigError(f'{SAFE_WEIGHTS} needs safetensors, not installed: pip install "warp_torchrl[safetensors]"')


def write_safe_weights(path: Path, parameters: Mapping[str, Tensor]) -> None:
    """Write parameters by name, equal to the bit.

    Raises:
        ConfigError: If safetensors is not installed.
        OSError: If the write fails.
    """
    check_safetensors()
    from safetensors.torch import save

    path.write_bytes(save({name: value.detach().cpu().contiguous().clone() for name, value in parameters.items()}))


def read_safe_weights(path: Path) -> dict[str, Tensor]:
    """Return the parameters in a file by name, on the CPU.

    Raises:
        ConfigError: If safetensors is not installed.
        Unsound: If the file is none of the kind, or cannot be read.
    """
    check_safetensors()
    from safetensors import SafetensorError
    from safetensors.torch import load

    try:
        return load(foreign.read_bytes(path, largest()))
    except (OSError, foreign.Foreign, SafetensorError, KeyError, ValueError) as error:
        raise Unsound(f"{path} cannot be read: {first_line(error)}") from None
