"""Numbers of a scenario, beside its components."""

from dataclasses import dataclass

from warp_torchrl.validation import check_fields


@dataclass(frozen=True, kw_only=True)
class EpisodeRules:
    """Time, measure and goal of a scenario's episodes.

    Attributes:
        steps_per_tick: Agent steps to a fire tick.
        horizon: Agent steps to an episode.
        cell_size: Side of a cell [m]; None takes the landscape's own, 30 m where it has none.
        action_masking: Whether agents are shown which actions would do something. Without it every mask is open, as
            the paper has it: what would do nothing can be chosen, and does nothing.
        goal: Name of the metric by which policies are compared; None: the trees saved, or the front watched where no
            vehicle can act.

    Raises:
        ValueError: If a value is out of its range.
    """

    steps_per_tick: int = 5
    horizon: int = 256
    cell_size: float | None = None
    action_masking: bool = True
    goal: str | None = None

    def __post_init__(self) -> None:
        check_fields(self, steps_per_tick=(1, 1000), horizon=(1, 1_000_000), cell_size=(0.01, 100_000.0))
