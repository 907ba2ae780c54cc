"""The folder of a policy, by its path, a shipped one's name, or the address of a repository."""

from pathlib import Path

from warp_torchrl.runs.manifest import CheckpointError
from warp_torchrl.runs.policies.hub import SCHEME, download
from warp_torchrl.system.shipped import policies_folder, policy_names
from warp_torchrl.validation import did_you_mean


def find_policy(given: str | Path) -> Path:
    """Return the folder of a path, of a shipped policy's name, or of ``hf://OWNER/NAME``; an existing path comes first.

    Raises:
        CheckpointError: If a single word is neither path nor name, or a repository holds no policy.
        ConfigError: If huggingface_hub is not installed and a repository is given.
    """
    if str(given).startswith(SCHEME):
        return download(str(given))
    path, names = Path(given), policy_names()
    if path.exists() or len(path.parts) != 1:
        return path
    if str(given) not in names:
        hint = did_you_mean(given, names)
        raise CheckpointError(f"{given} is not a run folder, nor one of the policies {', '.join(names)}{hint}")
    return policies_folder() / str(given)
