"""Synchronisations with a GPU: reads of results, and sizes that depend on results.

On CUDA torch reports them itself (``torch.cuda.set_sync_debug_mode``). On a CPU nothing waits, so the operations that
would wait on a GPU are counted; only copies between devices are missing there.
"""

import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode
from torch.utils._python_dispatch import TorchDispatchMode

_PACKAGE = str(Path(__file__).parents[1])
_ALWAYS = (
    "_local_scalar_dense",  # item(), float(), bool(), if
    "is_nonzero",
    "equal",
    "nonzero",
    "masked_select",
    "bincount",
    "_unique2",
    "unique_dim",
    "unique_consecutive",
)
_MASKS = ("index", "index_put", "index_put_", "_index_put_impl_")
_READS = (Tensor.tolist, Tensor.numpy, Tensor.__array__)  # of the host's memory: the dispatcher does not see them
_PICKS = (Tensor.__getitem__, Tensor.__setitem__)  # by a list: a copy too
_MAKERS = (torch.tensor, torch.as_tensor)  # of the program's numbers: a copy for whose end it waits
_CHECKED_ON_CPUS = torch.nn.functional.one_hot  # whose codes are looked at on a CPU alone, if it is told their number
_SYNCHRONISES = "called a synchronizing CUDA operation"


class Waits:
    """Counted synchronisations, by the line of this package that caused each."""

    def __init__(self) -> None:
        self.places: Counter[str] = Counter()
        self.pauses = False

    @property
    def count(self) -> int:
        """Return their number."""
        return self.places.total()

    def add(self, what: str) -> None:
        """Count one for the line that runs now."""
        self.places[f"{_place()}: {what}"] += 1


@contextmanager
def counted_waits(device: torch.device | str) -> Iterator[Waits]:
    """Count the synchronisations of a block on a GPU; on a CPU, the ones that it would cause on a GPU.

    Args:
        device: Device of the worlds. If it is a CPU, the code that a GPU would run must be inside
            ``warp_torchrl.system.device.unread()``.
    """
    found = Waits()
    if torch.device(device).type != "cpu":
        with _told_by_cuda(found):
            yield found
        return
    with _ReadsOfMemory(found), _Operations(found):
        yield found


@contextmanager
def _told_by_cuda(found: Waits) -> Iterator[None]:
    before, show = torch.cuda.get_sync_debug_mode(), warnings.showwarning

    def heard(message: Warning | str, *rest: Any, **more: Any) -> None:
        if _SYNCHRONISES in str(message):
            found.add("waits")
        else:
            show(message, *rest, **more)

    with warnings.catch_warnings():
        warnings.filterwarnings("always", message=f".*{_SYNCHRONISES}")
        warnings.showwarning = heard  # catch_warnings puts the former one back
        torch.cuda.set_sync_debug_mode("warn")
        try:
            yield
        finally:
            torch.cuda.set_sync_debug_mode(before)


class _Operations(TorchDispatchMode):
    def __init__(self, found: Waits) -> None:
        super().__init__()
        self._found = found

    def __torch_dispatch__(
        self, func: Any, types: Sequence[type], args: tuple[Any, ...] = (), kwargs: Mapping[str, Any] | None = None
    ) -> Any:
        if not self._found.pauses and would_wait(func, args, kwargs or {}):
            self._found.add(str(func))
        return func(*args, **(kwargs or {}))


class _ReadsOfMemory(TorchFunctionMode):
    def __init__(self, found: Waits) -> None:
        super().__init__()
        self._found = found

    def __torch_function__(
        self,
        func: Callable[..., Any],
        types: Sequence[type],
        args: tuple[Any, ...] = (),
        kwargs: Mapping[str, Any] | None = None,
    ) -> Any:
        picks = func in _PICKS and any(isinstance(each, list) for each in _parts(args[1]))
        makes = func in _MAKERS and (kwargs or {}).get("device") is not None and not isinstance(args[0], Tensor)
        if makes or picks or func in _READS:
            self._found.add(func.__name__)
        self._found.pauses = func is _CHECKED_ON_CPUS and (len(args) > 1 or "num_classes" in (kwargs or {}))
        try:
            return func(*args, **(kwargs or {}))
        finally:
            self._found.pauses = False


def would_wait(func: Any, args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> bool:
    """Return whether an operation of the dispatcher waits for a GPU when its tensors live there."""
    name = func.overloadpacket.__name__
    if name == "repeat_interleave":
        return kwargs.get("output_size") is None
    if name not in _MASKS:
        return name in _ALWAYS
    by_mask = any(isinstance(each, Tensor) and each.dtype in (torch.bool, torch.uint8) for each in args[1])
    return by_mask and not (name != "index" and args[2].numel() == 1)  # one number is filled in, without a wait


def _parts(index: Any) -> tuple[Any, ...]:
    return index if isinstance(index, tuple) else (index,)


def _place() -> str:
    """Return the innermost line of this package that is not of this file, or the innermost of all."""
    frames = [each for each in traceback.extract_stack() if each.filename != __file__]
    found = next((each for each in reversed(frames) if each.filename.startswith(_PACKAGE)), frames[-1])
    return f"{Path(found.filename).name}:{found.lineno}"
