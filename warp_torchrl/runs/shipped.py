"""The trained policies that come with the package, by name."""

from pathlib import Path

from warp_torchrl.nearest import did_you_mean
from warp_torchrl.runs.manifest import MANIFEST, CheckpointError


def policies_folder() -> Path:
    """Return the folder of the policies: inside the package when installed, in ``docs`` in a checkout."""
    package = Path(__file__).parents[1]
    inside = package / "policies"
    return inside if inside.is_dir() else package.parent / "docs" / "policies"


def policy_names() -> list[str]:
    """Return the names of the policies."""
    return sorted(manifest.parent.name for manifest in policies_folder().glob(f"*/{MANIFEST}"))


def find_policy(given: str | Path) -> Path:
    """Return the folder that a path or the name of a policy stands for; a path that exists goes before a name.

    Raises:
        CheckpointError: If it is one word that is neither.
    """
    path, names = Path(given), policy_names()
    if path.exists() or len(path.parts) != 1:
        return path
    if str(given) not in names:
        hint = did_you_mean(given, names)
        raise CheckpointError(f"{given} is not a run folder, nor one of the policies {', '.join(names)}{hint}")
    return policies_folder() / str(given)
