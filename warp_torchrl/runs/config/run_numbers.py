"""Numbers of a run, beside its components."""

from dataclasses import dataclass
from typing import Literal

import torch

from warp_torchrl.runs.config.seeds import MOST_WORLDS, SEEDS
from warp_torchrl.validation import check_fields


@dataclass(frozen=True, kw_only=True)
class RunNumbers:
    """Size, seed and machine of a run.

    Attributes:
        n_worlds: Worlds in the batch.
        total_frames: World steps in all; agent steps are frames x agents.
        seed: 0 to 2^31; no world of one is a world of another, or of an evaluation.
        device: ``cpu``, ``cuda`` or ``cuda:<number>``.
        processes: Processes that learn together, each from an equal share of the worlds; ``auto`` takes what
            ``parallel.automatic`` finds.
        graph: Record each step of the worlds, and each of the optimiser, as one CUDA graph.
        compile: Fuse steps and losses of training with ``torch.compile``: faster after a minute or two.
        plugins: Modules of the user's own whose components it has; see ``warp_torchrl.runs.config.plugins``.

    Raises:
        ValueError: If a value is out of its range.
    """

    n_worlds: int = 256
    total_frames: int = 2_000_000
    seed: int = 0
    device: str = "cpu"
    processes: int | Literal["auto"] = "auto"
    compile: bool = False
    graph: bool = False
    plugins: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self)
        if not 1 <= self.n_worlds <= MOST_WORLDS:
            raise ValueError(f"n_worlds must be in 1..{MOST_WORLDS}, got {self.n_worlds}")
        if not 1 <= self.total_frames <= 10**15:
            raise ValueError(f"total_frames must be in 1..1e15, got {self.total_frames}")
        if not 0 <= self.seed <= SEEDS:
            raise ValueError(f"seed must be in 0..{SEEDS}, got {self.seed}")
        _check_device(self.device)


def _check_device(name: str) -> None:
    try:
        device = torch.device(name)
    except RuntimeError:
        raise ValueError(f"device must be cpu, cuda or cuda:<number>, got {name}") from None
    if device.type not in ("cpu", "cuda"):
        raise ValueError(f"device must be cpu, cuda or cuda:<number>, got {name}")
    count = torch.cuda.device_count()
    if device.type == "cuda" and (device.index or 0) >= count:
        hint = "" if count else "; torch finds none here: choose device=cpu graph=false"
        raise ValueError(f"device must be one of this machine's {count} CUDA devices, got {name}{hint}")
