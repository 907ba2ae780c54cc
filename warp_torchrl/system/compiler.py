"""Functions that ``torch.compile`` fuses, where ``compile=true``.

Eager, each of their operations passes over every cell; fused, one loop does them all. The law and the draws are the
same, and on the CPU every bit of a world, but for the last places of exponentials: law ``hazard``, changing winds.
"""

import logging
import warnings
from collections.abc import Callable
from functools import cache
from typing import Any, ParamSpec, TypeVar

import torch

P = ParamSpec("P")
T = TypeVar("T")

FEW_CELLS = 2**12
"""Of all worlds; in a step of so many at most, to call a function takes longer than what it computes."""
_SHAPES = 256  # that one function may be compiled for; torch stops at 8
_IN_REGISTERS: dict[str, Any] = {
    "size_asserts": False,  # of what a guard has checked
    "realize_opcount_threshold": 200,
    "realize_reads_threshold": 1000,
    "realize_acc_reads_threshold": 1000,
}
# Else each element of a stack asks which of its parts it is of.
_IN_PARTS: dict[str, Any] = {"size_asserts": False, "max_pointwise_cat_inputs": 0}
_NOISE = (
    "Dynamo detected a call to a `functools.lru_cache`-wrapped function",  # of constants, which stay what they are
    "torch._dynamo.config.inline_inbuilt_nn_modules is deprecated",  # in tensordict
)
_EXTENSIONS = "torch.utils.cpp_extension"  # warns of CUDA_HOME on machines without a GPU, once in every process


@cache
def compiled(function: Callable[P, T], in_parts: bool = False) -> Callable[P, T]:
    """Return a pure function of tensors as one loop, compiled when it is first called with a shape.

    Each reader of a value computes it again, and none is stored: on the CPU a mask in memory costs more than the
    comparisons that made it. A function that is fused ``in_parts`` stores what several parts read.
    """
    torch._dynamo.config.recompile_limit = max(torch._dynamo.config.recompile_limit, _SHAPES)
    return compile_function(function, fullgraph=True, **(_IN_PARTS if in_parts else _IN_REGISTERS))


def compile_function(function: Callable[P, T], fullgraph: bool = False, **options: Any) -> Callable[P, T]:
    """Return a function that is compiled when it is first called with a shape.

    Globals of modules are taken to be constant: to check them at every call takes longer than a loss's sums, and
    tensordict's list of classes grows, so that all would be compiled again.

    Args:
        function: Of tensors.
        fullgraph: Whether a part that cannot be compiled is an error.
        options: Of Inductor.
    """
    _quieten()
    options["guard_filter_fn"] = torch.compiler.skip_guard_on_globals_unsafe
    return torch.compile(function, fullgraph=fullgraph, dynamic=False, options=options)


def _quieten() -> None:
    """Let torch's compiler warn of nothing that a user can do nothing about."""
    for message in _NOISE:
        warnings.filterwarnings("ignore", message=message)
    logging.getLogger(_EXTENSIONS).setLevel(logging.ERROR)


def vectors() -> str:
    """Return the vector instructions in force on the CPU, ``AVX512``, ``AVX2`` or what else torch names.

    The environment variable ``ATEN_CPU_CAPABILITY`` sets them, for Inductor too.
    """
    return torch.backends.cpu.get_cpu_capability()


def check_compiler(device: torch.device) -> None:
    """Check that ``torch.compile`` can work here.

    Raises:
        ValueError: If it finds no C++ compiler.
    """
    _quieten()
    from torch._inductor.cpp_builder import get_cpp_compiler
    from torch._inductor.exc import InvalidCxxCompiler

    if device.type != "cpu":
        return
    try:
        get_cpp_compiler()
    except InvalidCxxCompiler:
        raise ValueError("compile must be false here: torch.compile finds no C++ compiler (set CXX)") from None
