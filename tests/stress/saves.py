"""What is saved: the same harms come to each kind, and each must survive them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from tests.demonstrations.played import played
from tests.runs.test_checkpoint import saved
from warp_torchrl.demonstrations.files import find_recordings, read_recording
from warp_torchrl.demonstrations.files import save_recording as save_recording
from warp_torchrl.runs.checkpoint import newest
from warp_torchrl.runs.output import DRAFT


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of result.

    Attributes:
        save: Saves result number n of a folder.
        held: Returns the numbers of the results that a folder holds, each of them read whole; raises ``Unsound`` where
            one is broken.
        result: Returns the folder of result number n.
    """

    save: Callable[[Path, int], object]
    held: Callable[[Path], set[int]]
    result: Callable[[Path, int], Path]

    def files(self, folder: Path, number: int) -> list[Path]:
        """Return the files of a result."""
        return sorted(path for path in self.result(folder, number).rglob("*") if path.is_file())


def left(folder: Path) -> list[Path]:
    """Return what killed saves have left."""
    return list(folder.rglob(f"{DRAFT}*"))


def _checkpoints(run: Path) -> set[int]:
    found, skipped = newest(run)
    assert not skipped, skipped
    found.policy(), found.training(), found.saved_config()
    return {found.manifest.frames // 100, *(int(each.name) // 100 for each in (run / "checkpoints").glob("[0-9]*"))}


@cache
def _recording():
    return played("scenario=skirmish", steps=4)


KINDS = {
    "checkpoint": Kind(
        save=lambda run, number: saved(run, 100 * number, keep=2),
        held=_checkpoints,
        result=lambda run, number: run / "checkpoints" / f"{100 * number}",
    ),
    "recording": Kind(
        save=lambda people, number: save_recording(replace(_recording(), seed=number), people),
        held=lambda people: {read_recording(each).seed for each in find_recordings(people)},
        result=lambda people, number: people / f"skirmish-{number}-1",
    ),
}
