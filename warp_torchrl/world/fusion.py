"""Fuses the world's pure functions with ``torch.compile`` for those who ask for it: ``compile=true``.

Eager, each of their operations passes over every cell; fused, one loop does them all. The law and the draws are the
same, and on the CPU every bit.
"""

import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, wraps
from typing import Any, ParamSpec, TypeVar

import torch
from torch.compiler import is_compiling

P = ParamSpec("P")
T = TypeVar("T")

_SHAPES = 256  # that one function may be compiled for; torch stops at 8
_IN_REGISTERS = {
    "realize_opcount_threshold": 100_000,
    "realize_reads_threshold": 1000,
    "realize_acc_reads_threshold": 1000,
}
_IN_PARTS = {"max_pointwise_cat_inputs": 0}  # else each element of a stack asks which of its parts it is of
_fusing: ContextVar[bool] = ContextVar("fusing", default=False)


@contextmanager
def fusing(enabled: bool) -> Iterator[None]:
    """Fuse the functions marked ``fusible`` that are called inside, where enabled."""
    token = _fusing.set(enabled)
    try:
        yield
    finally:
        _fusing.reset(token)


def is_fusing() -> bool:
    """Return whether functions marked ``fusible`` are fused now, or one of them is being so."""
    return is_compiling() or _fusing.get()


def fusible(function: Callable[P, T]) -> Callable[P, T]:
    """Mark a function of tensors that changes nothing as one that may be fused, for each shape anew.

    What is computed of a cell is computed again for each who asks and kept for none: on the CPU a mask in memory costs
    more than the comparisons that made it.
    """
    return _fusible(function, _IN_REGISTERS)


def fusible_in_parts(function: Callable[P, T]) -> Callable[P, T]:
    """Mark a function as ``fusible`` does, one that keeps in memory what is asked for often."""
    return _fusible(function, _IN_PARTS)


def _fusible(function: Callable[P, T], options: Mapping[str, Any]) -> Callable[P, T]:
    @cache
    def fused() -> Callable[P, T]:
        torch._dynamo.config.recompile_limit = max(torch._dynamo.config.recompile_limit, _SHAPES)
        warnings.filterwarnings("ignore", message="Dynamo detected a call to a `functools.lru_cache`-wrapped function")
        return torch.compile(function, fullgraph=True, dynamic=False, options=dict(options))

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        fuse = not is_compiling() and _fusing.get()  # what is called inside of a function that is fused is a part of it
        return (fused() if fuse else function)(*args, **kwargs)

    return call


def check_compiler(device: torch.device) -> None:
    """Check that ``torch.compile`` can work here.

    Raises:
        ValueError: If it finds no C++ compiler.
    """
    from torch._inductor.cpp_builder import get_cpp_compiler
    from torch._inductor.exc import InvalidCxxCompiler

    if device.type != "cpu":
        return
    try:
        get_cpp_compiler()
    except InvalidCxxCompiler:
        raise ValueError("compile must be false here: torch.compile finds no C++ compiler (set CXX)") from None
