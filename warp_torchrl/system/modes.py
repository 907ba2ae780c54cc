"""Isolation from torch's global modes: default dtype and device, inference mode, autocast.

Worlds are float32 whatever torch's default type, and stay on their device whatever the default device. Tensors that are
kept between calls are made outside of inference mode, so that later code can write to them and learn from them.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import lru_cache, wraps
from typing import ParamSpec, TypeVar

import torch

P = ParamSpec("P")
T = TypeVar("T")
_KINDS = ("cpu", "cuda")
_CPU = torch.device("cpu")


def apart(function: Callable[P, T]) -> Callable[P, T]:
    """Return a function that ignores torch's modes: the default type and device, inference mode, autocast.

    Whether gradients are recorded does not change; in inference mode they are not.
    """

    @wraps(function)
    def call(*given: P.args, **named: P.kwargs) -> T:
        if torch.compiler.is_dynamo_compiling() or _is_plain():
            return function(*given, **named)
        with _plain():
            return function(*given, **named)

    return call


def kept(maxsize: int) -> Callable[[Callable[..., T]], Callable[..., T]]:
    """Return a decorator of functions that make constant tensors: it keeps them, made apart from torch's modes."""
    return lambda function: lru_cache(maxsize)(apart(function))


def _is_plain() -> bool:
    """Return whether no mode is set, in a few microseconds: a new tensor shows most modes."""
    new = torch.empty(0)
    return (
        new.dtype is torch.float32
        and new.device == _CPU
        and not new.is_inference()
        and not (torch.is_autocast_enabled("cpu") or torch.is_autocast_enabled("cuda"))
    )


@contextmanager
def _plain() -> Iterator[None]:
    dtype, records = torch.get_default_dtype(), torch.is_grad_enabled()
    with ExitStack() as modes:
        modes.callback(torch.set_default_dtype, dtype)
        torch.set_default_dtype(torch.float32)
        if torch.empty(0).device != _CPU:
            modes.enter_context(_CPU)
        for kind in filter(torch.is_autocast_enabled, _KINDS):
            modes.enter_context(torch.autocast(kind, enabled=False))
        modes.enter_context(torch.inference_mode(False))  # which lets gradients be recorded
        modes.enter_context(torch.set_grad_enabled(records))
        yield
