"""Fuses the world's pure functions with ``torch.compile`` for those who ask for it: ``compile=true``.

Eager, each of their operations passes over every cell; fused, one loop does them all. The law and the draws are the
same, and on the CPU every bit.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache, wraps
from typing import ParamSpec, TypeVar

import torch

P = ParamSpec("P")
T = TypeVar("T")

_SHAPES = 256  # that one function may be compiled for; torch stops at 8
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
    """Return whether functions marked ``fusible`` are fused now."""
    return _fusing.get()


def fusible(function: Callable[P, T]) -> Callable[P, T]:
    """Mark a function of tensors that changes nothing as one that may be fused, for each shape anew."""

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        return (_fused(function) if _fusing.get() else function)(*args, **kwargs)

    return call


@cache
def _fused(function: Callable[P, T]) -> Callable[P, T]:
    torch._dynamo.config.recompile_limit = max(torch._dynamo.config.recompile_limit, _SHAPES)
    return torch.compile(function, fullgraph=True, dynamic=False)


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
