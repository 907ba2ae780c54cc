"""The result of an evaluation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from warp_torchrl.evaluation.goal import SAVED
from warp_torchrl.evaluation.maps import maps_line
from warp_torchrl.evaluation.play import Episodes
from warp_torchrl.evaluation.report import evaluation_table, report
from warp_torchrl.world.mechanics.mechanic import Metric


@dataclass(frozen=True, kw_only=True)
class Result:
    """What a policy reached, and the baselines on the same fires; ``print`` shows it as a table.

    Attributes:
        scenario: Name of the scenario.
        policy: Name of the policy, with its mode.
        first_seed: Seed of world 0; world i has ``first_seed + i``.
        episodes: Final metrics of the policy's episodes by name, float64 [n] each; NaN where one has no value.
        baselines: The same of the baselines, by their name.
        other_modes: The same of the policy in its other mode, by name.
        left_out: The same of the policy without an agent, by the agent's name.
        method: Name in tables of many runs; None takes ``policy``.
        configuration: Digest that distinguishes policies of one method.
        world_overrides: Overrides by which the worlds differ from their scenario.
        frames: World steps of its last training; None for what was not trained.
        trained: Trainings behind it in one line; empty for what was not trained.
        goal: Metric by which policies of the team are compared.
        maps: Numbers of the maps; None where none were made.
        rows: Metrics of the worlds, for the table.
        folder: Where it was written; None of an evaluation on the way, or where nothing was written.
        wrote: Names of what was written there.
    """

    scenario: str
    policy: str
    first_seed: int
    episodes: Episodes
    baselines: Mapping[str, Episodes] = field(default_factory=dict)
    other_modes: Mapping[str, Episodes] = field(default_factory=dict)
    left_out: Mapping[str, Episodes] = field(default_factory=dict)
    method: str | None = None
    configuration: str = ""
    world_overrides: Sequence[str] = ()
    frames: int | None = None
    trained: str = ""
    goal: Metric = SAVED
    maps: Mapping[str, Any] | None = None
    rows: Sequence[Metric] = ()
    folder: Path | None = None
    wrote: Sequence[str] = ()

    def mean(self, metric: str = "saved") -> float:
        """Return the mean of a metric over the episodes that have a value; NaN where none has.

        Raises:
            KeyError: If the episodes have no such metric.
        """
        values = self.episodes[metric]
        known = values[~np.isnan(values)]
        return float(known.mean()) if known.size else float("nan")

    @cached_property
    def report(self) -> dict[str, Any]:
        """Return means, intervals, comparisons and every episode, as ``evaluation.json`` has them."""
        content = report(
            self.scenario,
            self.policy,
            self.first_seed,
            self.episodes,
            self.baselines,
            other_modes=self.other_modes,
            left_out=self.left_out,
            method=self.method,
            configuration=self.configuration,
            world_overrides=self.world_overrides,
            frames=self.frames,
            trained=self.trained,
            goal=self.goal,
        )
        return content if self.maps is None else {**content, "maps": self.maps}

    @property
    def picture(self) -> Path | None:
        """Return the file that shows the first fire; None where none was written."""
        found = [name for name in self.wrote if name.startswith("episode.")]
        return self.folder / found[0] if self.folder is not None and found else None

    def __str__(self) -> str:
        lines = [evaluation_table(self.report, self.rows)]
        return "\n".join(lines + ([] if self.maps is None else [maps_line(self.maps)]))

    def __repr__(self) -> str:
        return f"Result({self.scenario}, {self.policy}, {len(self.episodes['saved'])} fires)"
