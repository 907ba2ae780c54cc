"""Options of a search, besides the training."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from warp_torchrl.validation import check_fields


@dataclass(frozen=True, kw_only=True)
class SearchOptions:
    """Options of ``warp search`` under ``search``.

    Attributes:
        space: Values by key of a ready search, in the grammar of Hydra's sweeps; the command line adds to them.
        fixed: Overrides of a ready search, the same in all trials.
        trials: Number of trials that are trained to their end or pruned.
        seeds: Training seeds of each trial, from ``seed`` upwards; its value is their mean.
        jobs: Number of parallel trials.
        objective: Objective that is maximised: ``evaluation``, the forest that the trained policy saves on fires that
            no training and no other evaluation has, or ``training``, the mean of ``world/saved`` over the last fifth of
            a training.
        pruner: ``median`` ends a trial that at equal frames is below the median of those before it; ``hyperband`` gives
            few of the trials many frames; ``none``.
        prune_from: Share of a training before which no trial is pruned.
        startup: Trials that are drawn at random, and by ``median`` not pruned, before the search learns from them.
        keep_training: Keep the training state in the folders of ended trials, not only their policies: for a learner
            with a replay memory up to a gigabyte each.
        seed: Seed of the search's draws.
        out: Folder to write to, or of a search to resume; None makes one in ``outputs/searches``.

    Raises:
        ValueError: If a value is out of its range.
    """

    space: Mapping[str, Any] = field(default_factory=dict)
    fixed: tuple[str, ...] = ()
    trials: int = 30
    seeds: int = 1
    jobs: int = 1
    objective: Literal["evaluation", "training"] = "evaluation"
    pruner: Literal["median", "hyperband", "none"] = "median"
    prune_from: float = 0.25
    startup: int = 6
    keep_training: bool = False
    seed: int = 0
    out: str | None = None

    def __post_init__(self) -> None:
        check_fields(
            self,
            trials=(1, 100_000),
            seeds=(1, 100),
            jobs=(1, 1000),
            prune_from=(0.0, 1.0),
            startup=(1, 10_000),
            seed=(0, 2**31),
        )
        if self.out is not None and not self.out:
            raise ValueError("out must be a folder, got ''; null makes one in outputs/searches")
        for key, values in self.space.items():
            if not isinstance(values, str):
                raise ValueError(f"space must have values in the grammar of Hydra's sweeps, got {key}: {values!r}")
