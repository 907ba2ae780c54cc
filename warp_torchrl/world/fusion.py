"""Fuses pure functions of worlds with ``torch.compile`` for those who ask for it: ``compile=true``.

Eager, each of their operations passes over every cell; fused, one loop does them all. The law and the draws are the
same, and on the CPU every bit of a world, but for the last places of exponentials: law ``hazard``, changing winds.
"""

import warnings
from collections.abc import Callable
from functools import cache
from typing import Any, ParamSpec, TypeVar

import torch

P = ParamSpec("P")
T = TypeVar("T")

_SHAPES = 256  # that one function may be compiled for; torch stops at 8
COMMON: dict[str, Any] = {"guard_filter_fn": torch.compiler.skip_guard_on_globals_unsafe}
"""Options of whatever is compiled. Names of modules stay what they are, and to look at them at every call takes longer
than a loss's sums; tensordict's list of classes grows, and would have all compiled again."""
_IN_REGISTERS: dict[str, Any] = {
    "realize_opcount_threshold": 200,
    "realize_reads_threshold": 1000,
    "realize_acc_reads_threshold": 1000,
}
_IN_PARTS: dict[str, Any] = {
    "max_pointwise_cat_inputs": 0
}  # else each element of a stack asks which of its parts it is of


@cache
def fused(function: Callable[P, T], in_parts: bool = False) -> Callable[P, T]:
    """Return a function of tensors that changes nothing as one loop, compiled for each shape anew when it is called.

    What is computed of a cell is computed again for each who asks, and kept for none: on the CPU a mask in memory costs
    more than the comparisons that made it. A function that is fused ``in_parts`` keeps what is asked for often.
    """
    torch._dynamo.config.recompile_limit = max(torch._dynamo.config.recompile_limit, _SHAPES)
    warnings.filterwarnings("ignore", message="Dynamo detected a call to a `functools.lru_cache`-wrapped function")
    options = _IN_PARTS if in_parts else _IN_REGISTERS
    return torch.compile(function, fullgraph=True, dynamic=False, options=options | COMMON)


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
