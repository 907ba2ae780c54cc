"""A disk and a power cut: a save runs in a child that dies at a chosen file-system call, and loses what it may lose.

What a file got since its last fsync is lost in part, also where it was written through mapped memory: it is cut at
half. A name made in a folder since that folder's last fsync is lost or kept, as the caller says. A deletion is never
lost.
"""

import builtins
import io
import os
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

_DIED, _RETURNED = 9, 10


class _Disk:
    """The file-system calls of this process, counted, with the power cut before one of them."""

    def __init__(self, root: Path, fatal: int, loses_names: bool) -> None:
        self.root, self.fatal, self.loses_names = root, fatal, loses_names
        self.calls = 0
        self._flushed = {path.stat().st_ino: _state(path) for path in root.rglob("*") if path.is_file()}
        self._undo: list[tuple[int, Callable[[], None]]] = []  # inode of the folder, what takes its new name back

    def install(self) -> None:
        self._real = {name: getattr(os, name) for name in ("fsync", "mkdir", "rename", "replace", "unlink", "rmdir")}
        self._open = io.open
        for name in self._real:
            setattr(os, name, getattr(self, name))
        builtins.open = io.open = self.open

    def call(self) -> None:
        if self.calls == self.fatal:
            self.cut(_DIED)
        self.calls += 1

    def cut(self, code: int) -> None:
        """Lose what may be lost, and die."""
        self.fatal = -1
        for path in [each for each in self.root.rglob("*") if each.is_file()]:
            if self._flushed.get(path.stat().st_ino) != _state(path):
                os.truncate(path, path.stat().st_size // 2)
        for _, undo in reversed(self._undo if self.loses_names else []):
            with suppress(FileNotFoundError, NotADirectoryError):
                undo()
        os._exit(code)

    def open(self, file: Any, mode: str = "r", *args: Any, **options: Any) -> Any:
        if not set(mode) & set("wax+") or isinstance(file, int):
            return self._open(file, mode, *args, **options)
        self.call()
        is_new = not Path(file).exists()
        handle = self._open(file, mode, *args, **options)
        if is_new:
            self._named(file, lambda: self._real["unlink"](file))
        return _Handle(handle, self)

    def fsync(self, descriptor: int) -> None:
        self.call()
        self._real["fsync"](descriptor)
        inode = os.fstat(descriptor).st_ino
        self._flushed[inode] = _state(descriptor)
        self._undo = [each for each in self._undo if each[0] != inode]

    def mkdir(self, path: Any, *args: Any, **options: Any) -> None:
        self.call()
        self._real["mkdir"](path, *args, **options)
        self._named(path, lambda: shutil.rmtree(path, ignore_errors=True))

    def rename(self, source: Any, target: Any, **options: Any) -> None:
        self.call()
        self._real["rename"](source, target, **options)
        self._named(target, lambda: self._take_back(target, source))

    def _take_back(self, target: Any, source: Any) -> None:
        """Lose a new name: what had it is at its old one again, or nowhere where that folder has gone since."""
        if Path(source).parent.is_dir():
            self._real["rename"](target, source)
        else:
            shutil.rmtree(target, ignore_errors=True)

    def replace(self, source: Any, target: Any, **options: Any) -> None:
        self.call()
        self._real["replace"](source, target, **options)

    def unlink(self, path: Any, **options: Any) -> None:
        self.call()
        self._real["unlink"](path, **options)

    def rmdir(self, path: Any, **options: Any) -> None:
        self.call()
        self._real["rmdir"](path, **options)

    def _named(self, path: Any, undo: Callable[[], None]) -> None:
        self._undo.append((Path(path).parent.stat().st_ino, undo))


def _state(file: Path | int) -> tuple[int, int]:
    """Return the size and time of a file, one of which a write changes."""
    told = os.stat(file)  # noqa: PTH116, a descriptor has no path
    return told.st_size, told.st_mtime_ns


class _Handle:
    """A file whose writes are calls."""

    def __init__(self, handle: Any, disk: _Disk) -> None:
        self._handle, self._disk = handle, disk

    def __getattr__(self, name: str) -> Any:
        return getattr(self._handle, name)

    def __enter__(self) -> "_Handle":
        return self

    def __exit__(self, *error: object) -> None:
        self._handle.close()

    def write(self, data: Any) -> int:
        self._disk.call()
        return self._handle.write(data)


def with_power_cut(save: Callable[[], object], root: Path, fatal: int, loses_names: bool) -> bool:
    """Run a save in a child whose power is cut before its file-system call number ``fatal``, or when it has returned.

    Returns:
        Whether it had returned.
    """
    child = os.fork()
    if child == 0:
        try:
            disk = _Disk(root, fatal, loses_names)
            disk.install()
            save()
            disk.cut(_RETURNED)
        finally:
            os._exit(1)
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    assert code in (_DIED, _RETURNED), "the save failed by itself"
    return code == _RETURNED
