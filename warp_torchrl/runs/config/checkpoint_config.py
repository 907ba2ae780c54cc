"""The configuration of checkpoints."""

from dataclasses import dataclass

from warp_torchrl.validation import check_fields


@dataclass(frozen=True, kw_only=True)
class CheckpointConfig:
    """Times of checkpoints.

    Attributes:
        interval: Frames between checkpoints.
        minutes: Between checkpoints by the clock, as ``SaveClock`` has it; 0: none.
        keep: Checkpoints that stay: the newest two, and of the others those of the interval.

    Raises:
        ValueError: If the interval is not positive, the minutes are negative or fewer than two are kept.
    """

    interval: int = 500_000
    minutes: float = 2.0
    keep: int = 2

    def __post_init__(self) -> None:
        check_fields(self)
        if self.interval < 1:
            raise ValueError(f"interval must be at least 1 frame, got {self.interval}")
        if not 0.0 <= self.minutes <= 1e6:
            raise ValueError(f"minutes must be in 0..1e6, where 0 saves by frames alone, got {self.minutes}")
        if not 2 <= self.keep <= 10_000:
            raise ValueError(f"keep must be in 2..10000, got {self.keep}")
