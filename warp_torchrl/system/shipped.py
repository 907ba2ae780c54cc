"""The policies that ship with the package."""

from pathlib import Path


def policies_folder() -> Path:
    """Return the folder of the shipped policies: in the installed package, or in ``docs`` of a checkout."""
    package = Path(__file__).parents[1]
    inside = package / "policies"
    return inside if inside.is_dir() else package.parent / "docs" / "policies"


def policy_names() -> list[str]:
    """Return the names of the shipped policies."""
    return sorted(manifest.parent.name for manifest in policies_folder().glob("*/manifest.json"))
