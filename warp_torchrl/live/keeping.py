"""The recordings of a page's matches, in one folder."""

import shutil
from pathlib import Path

from warp_torchrl.demonstrations.files import MANIFEST, read_recording, save_recording, search
from warp_torchrl.demonstrations.recording import OpenRecording, Recording
from warp_torchrl.demonstrations.summary import Summary, summary
from warp_torchrl.live.crew import Refused
from warp_torchrl.live.side import Side
from warp_torchrl.system.checksummed import Unsound

_Written = tuple[int, int, int]


class Keeper:
    """Saves episodes. A later save of the same episode replaces the earlier one.

    Args:
        folder: Of the recordings; it is made when the first is saved.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.every = False
        """Whether ``keep`` saves."""
        self.changes = 0
        """How often the list of recordings may have changed."""
        self._last: tuple[OpenRecording, tuple[int, int], Path, _Written | None] | None = None
        self._known: dict[tuple[Path, _Written | None], Summary | str] = {}

    def save(self, side: Side) -> Path:
        """Save what a side has played so far, and return its folder.

        Raises:
            Refused: If nothing was played, or the folder cannot be written; nothing is lost then.
        """
        recording = side.record()
        try:
            folder = save_recording(recording, self.folder)
        except OSError as error:
            raise Refused(
                f"{error.filename or self.folder} cannot be written ({error.strerror}): this episode is not saved"
            ) from None
        except Unsound as error:
            raise Refused(f"this episode is not saved: {error}") from None
        if self._last is not None and self._last[0] is side.open_recording:
            _, _, before, written = self._last
            if written is not None and _written(before) == written:  # and not another's of the same name
                shutil.rmtree(before, ignore_errors=True)
        self._last = (side.open_recording, _length(side.open_recording), folder, _written(folder))
        self.changes += 1
        return folder

    def keep(self, side: Side) -> Path | None:
        """Save an episode that ends, or is left, if people did something in it; return its folder.

        Returns:
            None where nothing is to be saved: ``every`` is off, nobody did anything, or all of it is saved.

        Raises:
            Refused: As of ``save``.
        """
        played = side.open_recording
        is_saved = self._last is not None and self._last[0] is played and self._last[1] == _length(played)
        if not self.every or not played.has_people or not played.rows or is_saved:
            return None
        return self.save(side)

    def recordings(self) -> tuple[dict[str, Summary | str], int]:
        """Return the recordings of this folder, and the number of recordings whose names are refused.

        Returns:
            The summary of each recording, or why it is broken, by its path in this folder; and the number that is left
            out.
        """
        found, (folders, left_out) = {}, self._folders()
        for name, folder in folders.items():
            key = (folder, _written(folder))
            if key not in self._known:
                try:
                    self._known[key] = summary(folder, read_recording(folder))
                except (Unsound, OSError) as error:
                    self._known[key] = str(error)
            found[name] = self._known[key]
        return found, left_out

    def read(self, name: str) -> Recording:
        """Return a recording of ``recordings``, verified.

        Raises:
            Refused: If there is none of the name.
            Unsound: If it is broken.
        """
        folders, _ = self._folders()
        if name not in folders:
            raise Refused(f"{self.folder} holds no recording {name}")
        return read_recording(folders[name])

    def _folders(self) -> tuple[dict[str, Path], int]:
        """Return the folders of recordings by their paths in this one, and how many are refused for their names."""
        found, left_out = search(self.folder)
        return {str(folder.relative_to(self.folder)): folder for folder in found}, len(left_out)


def _written(folder: Path) -> _Written | None:
    """Return the identity of a recording's manifest, which changes when it is written again; None without one."""
    try:
        found = (folder / MANIFEST).stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino, found.st_mtime_ns


def _length(open_recording: OpenRecording) -> tuple[int, int]:
    return len(open_recording.rows), len(open_recording.events)
