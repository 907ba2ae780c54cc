"""Where an evaluation may write: where nothing else is, unless it is told to replace what is there."""

from pathlib import Path

from warp_torchrl.config.construction import ConfigError

_OF_HYDRA = (".hydra", "multirun.yaml")  # which comes before the evaluation, as its logs do
_NAMED = 3


def check_free(folder: Path, key: str) -> None:
    """Check that a folder is new, is empty, or holds nothing but logs.

    Args:
        folder: Need not be there.
        key: Of the configuration, which names it.

    Raises:
        ConfigError: If it holds anything else.
    """
    there = [each.name for each in folder.iterdir()] if folder.is_dir() else []
    held = [name for name in there if name not in _OF_HYDRA and not name.endswith(".log")]
    if held:
        raise ConfigError(
            f"{key}: {folder} holds {_described(held)}; take another folder, or overwrite=true, which replaces what an "
            f"evaluation writes"
        )


def _described(names: list[str]) -> str:
    names = sorted(names, key=lambda name: (name.startswith("."), name))
    what = "a run: " if "checkpoints" in names else "an evaluation: " if "evaluation.json" in names else ""
    more = len(names) - _NAMED
    return what + ", ".join(names[:_NAMED]) + (f" and {more} more" if more > 0 else "")
