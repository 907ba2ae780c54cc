"""Policies in repositories of Hugging Face: ``hf://OWNER/NAME``, or ``hf://OWNER/NAME@REVISION``.

Three files of a repository are read: the manifest, the configuration and ``policy.safetensors``. They are plain values
and numbers, verified as those of any policy are. Pickles and code are not downloaded.
"""

import os
import re
from importlib.util import find_spec
from pathlib import Path

from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.manifest import MANIFEST, SAFE_POLICY, CheckpointError
from warp_torchrl.runs.safe_weights import check_safetensors
from warp_torchrl.system.checksummed import first_line

SCHEME = "hf://"
"""Begin of the address of a repository."""
_ADDRESS = re.compile(r"hf://(?P<name>[A-Za-z0-9][\w.-]*/[A-Za-z0-9][\w.-]*)(?:@(?P<revision>[A-Za-z0-9][\w./-]*))?")


def download(address: str) -> Path:
    """Return the folder of a policy in a repository; a file is downloaded where the cache lacks it or has another.

    Raises:
        ConfigError: If the address is none, or huggingface_hub or safetensors is not installed.
        CheckpointError: If the download fails, or the repository holds no policy as safetensors.
    """
    found = _ADDRESS.fullmatch(address)
    if found is None or ".." in address:
        raise ConfigError(f"a repository must be hf://OWNER/NAME or hf://OWNER/NAME@REVISION, got {address}")
    if find_spec("huggingface_hub") is None:
        raise ConfigError(f'{address} needs huggingface_hub, not installed: pip install "warp_torchrl[hub]"')
    check_safetensors()
    folder = _cache() / address.removeprefix(SCHEME).replace("/", "--")
    _fetch(address, found["name"], found["revision"], folder)
    missing = [name for name in (MANIFEST, *SAFE_POLICY) if not (folder / name).is_file()]
    if missing:
        raise CheckpointError(f"{address} has no {', '.join(missing)}: export a policy with format=safetensors")
    return folder


def _fetch(address: str, name: str, revision: str | None, folder: Path) -> None:
    from huggingface_hub import snapshot_download

    try:
        snapshot_download(name, revision=revision, local_dir=folder, allow_patterns=[MANIFEST, *SAFE_POLICY])
    except Exception as error:  # it raises what its library of HTTP does
        raise CheckpointError(f"{address} cannot be downloaded: {first_line(error)}") from None


def _cache() -> Path:
    """Return the folder of the files: ``warp_torchrl/hub`` in ``XDG_CACHE_HOME``, or in ``~/.cache``."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "warp_torchrl" / "hub"
