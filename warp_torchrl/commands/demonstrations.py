"""The command demonstrations: recordings of people and policies in numbers, played again, and as NumPy arrays."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from warp_torchrl.commands.failure import DONE, fail
from warp_torchrl.config.construction import ConfigError, construct
from warp_torchrl.config.grammar import check_flags
from warp_torchrl.demonstrations.export import export
from warp_torchrl.demonstrations.files import find, read
from warp_torchrl.demonstrations.recording import Recording
from warp_torchrl.demonstrations.replay import Replay
from warp_torchrl.demonstrations.summary import summary, table
from warp_torchrl.runs.sealed import Unsound
from warp_torchrl.validation import check_fields

USAGE = "python -m warp_torchrl.demonstrations FOLDER [check=true] [export=FILE.npz]"


@dataclass(frozen=True, kw_only=True)
class DemonstrationOptions:
    """What ``python -m warp_torchrl.demonstrations`` is told.

    Attributes:
        folder: A recording, or a folder of recordings.
        check: Play each again, and hold it against what was recorded.
        export: File to write the steps of all of them into, as NumPy arrays; None writes none.
        overwrite: Write over a file that is there.
        debug: Print a traceback when something fails.

    Raises:
        ValueError: If a value does not fit, or the file is there already.
    """

    folder: str
    check: bool = False
    export: str | None = None
    overwrite: bool = False
    debug: bool = False

    def __post_init__(self) -> None:
        check_fields(self)
        if self.export is None:
            return
        path = Path(self.export)
        if path.suffix != ".npz":
            raise ValueError(f"export must be a file that ends in .npz, got {path}")
        if path.exists() and not self.overwrite:
            raise ValueError(f"export must be a new file, got {path}; overwrite=true writes over it")


def main(arguments: Sequence[str] | None = None) -> int:
    """List, check and export what the command line asks for, and return the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if any(each in ("-h", "--help") for each in given):
        print(f"{USAGE}\n\n{DemonstrationOptions.__doc__}")
        return DONE
    try:
        return _run(_read(given))
    except Exception as error:
        return fail(error, "debug=true" in given)[0]


def _read(arguments: Sequence[str]) -> DemonstrationOptions:
    """Return what the command line asks for.

    Raises:
        ConfigError: If a word does not fit, in one line.
    """
    check_flags(arguments)
    folders = [each for each in arguments if "=" not in each]
    if len(folders) != 1:
        raise ConfigError(f"one folder of recordings is expected, got {' '.join(folders) or 'none'}: {USAGE}")
    pairs = [each.partition("=") for each in arguments if "=" in each]
    words = {"true": True, "false": False, "null": None}
    values = {key: words.get(value.lower(), value) for key, _, value in pairs}
    return construct(DemonstrationOptions, {"folder": folders[0], **values}, "")


def _run(options: DemonstrationOptions) -> int:
    sound: dict[Path, Recording] = {}
    broken: list[str] = []
    for folder in find(Path(options.folder)):
        try:
            sound[folder] = read(folder)
            if options.check:
                Replay(sound[folder]).check()
        except (Unsound, ConfigError) as error:
            broken.append(f"{folder.name}: {' '.join(str(error).split())}")
    print(table(summary(folder, recording) for folder, recording in sound.items()), flush=True)
    if broken:
        raise Unsound("; ".join(broken) + ("; nothing was exported" if options.export else ""))
    if options.check:
        print(f"{len(sound)} of {len(sound)} play again as they were recorded", flush=True)
    if options.export is not None:
        export(list(sound.values()), Path(options.export))
        print(f"wrote {sum(len(each.steps) for each in sound.values())} steps into {options.export}", flush=True)
    return DONE
