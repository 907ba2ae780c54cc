"""The shipped policies, by name."""

from pathlib import Path

from warp_torchrl.nearest import did_you_mean
from warp_torchrl.runs.manifest import MANIFEST, CheckpointError


def policies_folder() -> Path:
    """Return the folder of the shipped policies: in the installed package, or in ``docs`` of a checkout."""
    package = Path(__file__).parents[1]
    inside = package / "policies"
    return inside if inside.is_dir() else package.parent / "docs" / "policies"


def policy_names() -> list[str]:
    """Return the names of the shipped policies."""
    return sorted(manifest.parent.name for manifest in policies_folder().glob(f"*/{MANIFEST}"))


def find_policy(given: str | Path) -> Path:
    """Return the folder of a path or of a shipped policy's name; an existing path comes first.

    Raises:
        CheckpointError: If a single word is neither.
    """
    path, names = Path(given), policy_names()
    if path.exists() or len(path.parts) != 1:
        return path
    if str(given) not in names:
        hint = did_you_mean(given, names)
        raise CheckpointError(f"{given} is not a run folder, nor one of the policies {', '.join(names)}{hint}")
    return policies_folder() / str(given)
