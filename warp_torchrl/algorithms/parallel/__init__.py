"""Processes that learn together: their start, and their messages."""

from warp_torchrl.algorithms.parallel.group import WorkerDied, gather, mean_, rank, share, size, standardised, sum_
from warp_torchrl.algorithms.parallel.launch import automatic, follow, join, processes
from warp_torchrl.algorithms.parallel.torchrun import is_torchrun, torchrun_rank

__all__ = [
    "WorkerDied",
    "automatic",
    "follow",
    "gather",
    "is_torchrun",
    "join",
    "mean_",
    "processes",
    "rank",
    "share",
    "size",
    "standardised",
    "sum_",
    "torchrun_rank",
]
