"""Processes that learn together: how they start, and what they tell each other."""

from warp_torchrl.parallel.group import WorkerDied, gather, mean_, rank, share, size, standardised, sum_
from warp_torchrl.parallel.launch import automatic, follow, join, processes
from warp_torchrl.parallel.parent import SECONDS_TO_SAVE, end_with, is_orphaned
from warp_torchrl.parallel.torchrun import is_torchrun, torchrun_rank

__all__ = [
    "SECONDS_TO_SAVE",
    "WorkerDied",
    "automatic",
    "end_with",
    "follow",
    "gather",
    "is_orphaned",
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
