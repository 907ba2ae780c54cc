"""The compiler, for functions of tensors: whether it fuses them, and operators that it leaves alone.

No other module of the world speaks of it. ``system.compiler`` fuses functions.
"""

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import torch

from warp_torchrl.system.compiler import FEW_CELLS

P = ParamSpec("P")
T = TypeVar("T")

is_fused = torch.compiler.is_dynamo_compiling
"""Return whether the calling function is being fused. A step of one world calls it some eighty times, and
``torch.compiler.is_compiling`` takes twice as long."""

constant = torch.compiler.assume_constant_result
"""Return a function that fused ones call once, as they are compiled: what it returns follows from its arguments."""

_OPERATORS = torch.library.Library("warp_torchrl", "FRAGMENT")
_FUNCTIONS: dict[str, tuple[Callable[..., Any], Callable[..., Any]]] = {}
"""Of each operator by name: what it computes, and what tells its result's shape."""


def opaque_op(schema: str, like: Callable[..., Any] | None = None) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Return a decorator: compiled functions call the function without compiling it, and keep its result in memory.

    A compiler would repeat the function's code at every call, or test each element where the function takes a slice. Of
    few cells it does, since a call takes longer.

    Args:
        schema: Of its arguments and its result, in torch's language.
        like: Returns a tensor of the result's shape and type; None takes the function itself.
    """

    def opaque(function: Callable[P, T]) -> Callable[P, T]:
        name = function.__name__.strip("_")
        known = name in _FUNCTIONS  # of a module that is imported again: an operator cannot be defined twice
        _FUNCTIONS[name] = function, like or function
        if not known:
            _OPERATORS.define(name + schema)  # a ``custom_op`` takes three times as long to call
            _OPERATORS.impl(name, lambda *given: _FUNCTIONS[name][0](*given), "CompositeExplicitAutograd")
            fake = torch.library.register_fake(f"warp_torchrl::{name}", lib=_OPERATORS)
            fake(lambda *given: _FUNCTIONS[name][1](*given))
        operator = getattr(torch.ops.warp_torchrl, name).default

        @wraps(function)
        def either(*args: P.args, **kwargs: P.kwargs) -> T:
            return (operator if is_fused() and not _are_few(args) else function)(*args, **kwargs)

        return either

    return opaque


def _are_few(given: tuple[Any, ...]) -> bool:
    """Return whether tensors that a function is given have few cells."""
    return all(each.numel() <= FEW_CELLS for each in given if isinstance(each, torch.Tensor))
