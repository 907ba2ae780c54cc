"""The command demonstrations: recordings as a table, checked by replay, as NumPy arrays, and as an HTML page."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from warp_torchrl.commands.failure import DONE
from warp_torchrl.commands.program import command_help, run_program
from warp_torchrl.demonstrations.export import export_arrays
from warp_torchrl.demonstrations.files import find_recordings, read_recording
from warp_torchrl.demonstrations.recording import Recording
from warp_torchrl.demonstrations.replay import Replay
from warp_torchrl.demonstrations.summary import recordings_table, summary
from warp_torchrl.runs.config.construction import ConfigError, construct
from warp_torchrl.runs.config.grammar import check_flags, own_values
from warp_torchrl.system.checksummed import Unsound
from warp_torchrl.validation import check_fields

USAGE = "warp demonstrations FOLDER [check=true] [export=FILE.npz] [html=FILE.html]"


@dataclass(frozen=True, kw_only=True)
class DemonstrationOptions:
    """Options of ``warp demonstrations``.

    Attributes:
        folder: A recording, or a folder of recordings.
        check: Replay each recording, and compare the result with what was recorded.
        export: File for the steps of all of them, as NumPy arrays; None writes none.
        html: File for the one recording, as a page that plays in a browser by itself, extra ``live``.
        overwrite: Write over a file that is there.
        debug: Print a traceback when something fails.

    Raises:
        ValueError: If a value does not fit, or the file is there already.
    """

    folder: str
    check: bool = False
    export: str | None = None
    html: str | None = None
    overwrite: bool = False
    debug: bool = False

    def __post_init__(self) -> None:
        check_fields(self)
        for key, ending in (("export", ".npz"), ("html", ".html")):
            if getattr(self, key) is None:
                continue
            path = Path(getattr(self, key))
            if path.suffix != ending:
                raise ValueError(f"{key} must be a file that ends in {ending}, got {path}")
            if path.exists() and not self.overwrite:
                raise ValueError(f"{key} must be a new file, got {path}; overwrite=true writes over it")
        if self.html is not None and find_spec("viser") is None:
            raise ValueError('html needs viser, not installed: pip install "warp_torchrl[live]"')


def main(arguments: Sequence[str] | None = None) -> int:
    """List, check and export the recordings of the command line, and return the exit code."""
    return run_program(arguments, command_help(USAGE, DemonstrationOptions), lambda given: _run(_read(given)))


def _read(arguments: Sequence[str]) -> DemonstrationOptions:
    """Return the options of a command line.

    Raises:
        ConfigError: If a word does not fit, in one line.
    """
    check_flags(arguments)
    folders = [each for each in arguments if "=" not in each]
    if len(folders) != 1:
        raise ConfigError(f"one folder of recordings is expected, got {' '.join(folders) or 'none'}: {USAGE}")
    given = [each for each in arguments if "=" in each]
    given = [each for each in given if not each.startswith("plugins=")]  # imported, and nobody's option
    values, _ = own_values(given, [each.partition("=")[0] for each in given], texts=("export", "html"))
    return construct(DemonstrationOptions, {"folder": folders[0], **values}, "")


def _run(options: DemonstrationOptions) -> int:
    folders = find_recordings(Path(options.folder))
    if options.html is not None and len(folders) != 1:
        raise ConfigError(f"html must be of one recording, and {options.folder} holds {len(folders)}: name one of them")
    sound: dict[Path, Recording] = {}
    broken: list[str] = []
    for folder in folders:
        try:
            sound[folder] = read_recording(folder)
            if options.check:
                Replay(sound[folder]).check()
        except (Unsound, ConfigError) as error:
            broken.append(f"{folder.name}: {' '.join(str(error).split())}")
    print(recordings_table(summary(folder, recording) for folder, recording in sound.items()), flush=True)
    if broken:
        raise Unsound("; ".join(broken) + ("; nothing was written" if options.export or options.html else ""))
    if options.check:
        print(f"{len(sound)} of {len(sound)} play again as they were recorded", flush=True)
    if options.export is not None:
        export_arrays(list(sound.values()), Path(options.export))
        print(f"wrote {sum(len(each.steps) for each in sound.values())} steps into {options.export}", flush=True)
    if options.html is not None:
        _film(next(iter(sound.values())), Path(options.html))
        print(f"wrote {options.html}", flush=True)
    return DONE


def _film(recording: Recording, path: Path) -> None:
    """Write a recording as a page that plays in a browser; replay verifies it."""
    from warp_torchrl.live.episode import SceneRecorder  # the extra live

    replay = Replay(recording)
    scene = SceneRecorder(f"{recording.scenario}\n{recording.policy} and people, seed {recording.seed}", replay.env)
    for state in replay.states():
        scene.add(state)
    scene.save(path)
