"""Outputs of commands: drafts that are locked, flushed to the disk, and renamed when they are complete."""

import errno
import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from warp_torchrl.runs.destination import DRAFT, check_free
from warp_torchrl.system import disk
from warp_torchrl.system.lock import RunFolderLock

__all__ = ["DRAFT", "draft_in", "output_folder", "publish", "remove_if_empty", "sync_all"]
_TAKEN = (errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR)


@contextmanager
def output_folder(
    folder: Path, key: str, *, overwrite: bool, last: str, replaced: Iterable[str] = ()
) -> Iterator[Path]:
    """Lock an output folder, and yield a draft in it; the block's files are moved into the folder at the end.

    The folder is made first, so that a long computation begins only where its result can be written, and a second
    command is refused at once. If the block fails, the folder is as it was before, and folders above it that were made
    for it are gone.

    Args:
        folder: The output folder.
        key: The configuration key that names it.
        overwrite: Whether it may hold an output.
        last: The file that is moved last: a folder that has it is complete. An earlier one is removed first.
        replaced: Patterns of other files that an earlier output may have left, and which this one replaces.

    Yields:
        The draft, an empty folder.

    Raises:
        ConfigError: If the folder holds an output already, and ``overwrite`` is not set.
        RunFolderInUse: If another process writes into it.
        OSError: If it cannot be made or written, with the path.
    """
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    with disk.with_path(folder):
        lock = RunFolderLock(folder)
    try:
        if not overwrite:
            check_free(folder, key)
        with draft_in(folder) as draft:
            yield draft
            _fill(folder, draft, last, replaced)
    except BaseException:
        for each in made:
            remove_if_empty(each)
        raise
    finally:
        lock.release()


@contextmanager
def draft_in(parent: Path) -> Iterator[Path]:
    """Yield a new empty folder below another, with a name that no other process uses; it is deleted at the end.

    Drafts that killed processes left there are removed first.

    Raises:
        OSError: If it cannot be made, with the path.
    """
    with disk.with_path(parent):
        parent.mkdir(parents=True, exist_ok=True)
        _remove_left(parent)
        apart, lock = _locked_folder(parent)
    try:
        draft = apart / "draft"  # with the user's permissions, where the folder around it has none for others
        draft.mkdir()
        yield draft
    finally:
        shutil.rmtree(apart, ignore_errors=True)
        os.close(lock)


def publish(draft: Path, parent: Path, names: Iterable[str]) -> Path:
    """Flush a draft to the disk, and rename it to the first name that is free, also among other processes.

    Args:
        draft: What ``draft_in`` yielded.
        parent: Folder of the result.
        names: Names to try, in their order.

    Returns:
        The result's folder.

    Raises:
        FileExistsError: If all names are taken.
        OSError: If a file cannot be flushed, with the path.
    """
    sync_all(draft)
    taken = parent
    for taken in (parent / name for name in names):
        if taken.exists() or taken.is_symlink():
            continue
        try:
            draft.rename(taken)
        except OSError as error:
            if error.errno not in _TAKEN:
                raise
            continue
        disk.sync(parent)
        return taken
    raise FileExistsError(errno.EEXIST, "it is there already", str(taken))


def sync_all(folder: Path) -> None:
    """Flush every file below a folder, and the folders, to the disk (fsync).

    Raises:
        OSError: If one cannot be flushed, with the path.
    """
    for path in (*folder.rglob("*"), folder):
        with disk.with_path(path):
            disk.sync(path)


def remove_if_empty(folder: Path) -> None:
    """Remove a folder that holds nothing but its lock; files of others stay."""
    with suppress(OSError):
        if {each.name for each in folder.iterdir()} <= {".lock"}:
            (folder / ".lock").unlink(missing_ok=True)
            folder.rmdir()


def _fill(folder: Path, draft: Path, last: str, replaced: Iterable[str]) -> None:
    """Move a draft's files into a folder, the last file after all others are on the disk."""
    if not (draft / last).is_file():
        raise FileNotFoundError(errno.ENOENT, "the output has no such file", str(draft / last))
    sync_all(draft)
    with disk.with_path(folder):
        (folder / last).unlink(missing_ok=True)
        for path in [each for pattern in replaced for each in folder.glob(pattern)]:
            _remove(path)
        files = [path.relative_to(draft) for path in draft.rglob("*") if path.is_file()]
        for name in sorted(files, key=lambda each: each == Path(last)):
            if name == Path(last):
                disk.sync(folder)
            (folder / name).parent.mkdir(exist_ok=True)
            (draft / name).replace(folder / name)
            disk.sync((folder / name).parent)
        disk.sync(folder)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _locked_folder(parent: Path) -> tuple[Path, int]:
    """Make a folder and lock it; make another if a process that removes old drafts interfered."""
    while True:
        apart = Path(tempfile.mkdtemp(prefix=DRAFT, dir=parent))
        with suppress(FileNotFoundError, BlockingIOError):
            descriptor = _lock(apart)
            if apart.is_dir():
                return apart, descriptor
            os.close(descriptor)


def _lock(folder: Path) -> int:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def _remove_left(parent: Path) -> None:
    """Remove drafts without a lock: their processes have ended."""
    for left in parent.glob(f"{DRAFT}*"):
        with suppress(OSError):  # it is in use, or is no folder of ours
            descriptor = _lock(left)
            shutil.rmtree(left, ignore_errors=True)
            os.close(descriptor)
