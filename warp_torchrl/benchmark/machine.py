"""The machine of a benchmark: processor, threads and library versions."""

import os
import platform
import resource
import sys
from pathlib import Path
from typing import Any

import numpy as np
import tensordict
import torch
import torchrl

from warp_torchrl.benchmark.timing import is_alone
from warp_torchrl.models.networks import computes_in_half
from warp_torchrl.system.compiler import vectors


def machine(device: str) -> dict[str, Any]:
    """Return the machine's properties that matter for a comparison of figures."""
    return {
        "platform": platform.platform(),
        "processor": _processor(),
        "vectors": vectors(),
        "bfloat16": computes_in_half("cpu"),
        "cores": os.cpu_count(),
        "threads": torch.get_num_threads(),
        "device": device if device == "cpu" else torch.cuda.get_device_name(device),
        "clock": "processor time" if is_alone(device) else "wall clock",
        "python": platform.python_version(),
        "torch": torch.__version__,
        "torchrl": torchrl.__version__,
        "tensordict": tensordict.__version__,
        "numpy": np.__version__,
    }


def header(found: dict[str, Any]) -> str:
    """Return the machine in two lines, with the vector instructions in force."""
    libraries = ", ".join(f"{name} {found[name]}" for name in ("torch", "torchrl", "tensordict", "numpy"))
    device = "" if found["device"] == "cpu" else f", {found['device']}"
    kind = found["vectors"] + (", bfloat16" if found["bfloat16"] else "")
    units = f"cores: {found['cores']}, threads: {found['threads']}{device}"
    return (
        f"{found['platform']}, {found['processor']} ({kind}), {units}\n"
        f"Python {found['python']}, {libraries}; times: {found['clock']}"
    )


def peak_memory() -> float:
    """Return the peak memory of this process [GiB]."""
    unit = 1 if sys.platform == "darwin" else 1024  # bytes there, KiB elsewhere
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 2**30


def _processor() -> str:
    listing = Path("/proc/cpuinfo")
    lines = listing.read_text().splitlines() if listing.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
