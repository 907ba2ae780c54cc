"""The output folder of an evaluation: it must hold nothing else, unless ``overwrite=true``."""

from pathlib import Path

from warp_torchrl.runs.config.construction import ConfigError

LARGEST_EVALUATION = 200_000_000
"""Size of an ``evaluation.json`` that is read [bytes]."""
_OF_HYDRA = (".hydra", "multirun.yaml")  # Hydra writes these, and logs, before the evaluation
DRAFT = ".warp_torchrl-draft-"
"""What names of drafts begin with. A draft that nobody has locked is of a process that was killed."""
_LEFT = (".lock", DRAFT)  # of a process that was killed before it had written anything
_NAMED = 3


def check_free(folder: Path, key: str) -> None:
    """Check that a folder does not exist, is empty, or holds nothing but logs.

    Args:
        folder: The output folder.
        key: The configuration key that names it.

    Raises:
        ConfigError: If the folder holds anything else.
    """
    there = [each.name for each in folder.iterdir()] if folder.is_dir() else []
    held = [name for name in there if not (name in _OF_HYDRA or name.endswith(".log") or name.startswith(_LEFT))]
    if held:
        raise ConfigError(
            f"{key}: {folder} holds {_described(held)}; take another folder, or overwrite=true, which replaces what "
            f"this command writes"
        )


def _described(names: list[str]) -> str:
    names = sorted(names, key=lambda name: (name.startswith("."), name))
    what = "a run: " if "checkpoints" in names else "an evaluation: " if "evaluation.json" in names else ""
    more = len(names) - _NAMED
    return what + ", ".join(names[:_NAMED]) + (f" and {more} more" if more > 0 else "")
