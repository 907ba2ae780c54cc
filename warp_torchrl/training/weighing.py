"""Weights of a mixture's kinds in the loss, by the trees that remain to be saved."""

import logging
from collections.abc import Mapping, Sequence
from typing import Any

from warp_torchrl.collection.mixture import Mixture, weights
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.training.baseline import baseline_results

log = logging.getLogger("warp_torchrl")

_MEMORY = 0.8
"""Share of what was saved before in what is taken for saved after a batch."""


class Weighing:
    """Weights of the kinds, from the trees saved by the team and by a baseline.

    Args:
        mixture: Configuration.
        names: Names of the kinds.
        shares: Shares of the worlds.
        baseline: Shares of trees that the baseline saves.
    """

    def __init__(
        self, mixture: Mixture, names: Sequence[str], shares: Sequence[float], baseline: Sequence[float]
    ) -> None:
        self.mixture, self.names, self.shares, self.baseline = mixture, names, shares, tuple(baseline)
        self.saved: list[float | None] = [None for _ in shares]
        """Running means of the shares of trees that the team saves in episodes that end."""

    def weights(self) -> list[float]:
        """Return the weight of each kind; they add up to 1."""
        return weights(self.shares, self.saved, self.baseline, self.mixture.floor)

    def columns(self, row: Mapping[str, float | None]) -> dict[str, float | None]:
        """Return the columns of the weights of a batch, and update the team's results from its row."""
        found: dict[str, float | None] = {
            f"mixture/weight_{name}": weight for name, weight in zip(self.names, self.weights(), strict=True)
        }
        for at, name in enumerate(self.names):
            before, now = self.saved[at], row[f"mixture/saved_{name}"]
            if now is not None:
                self.saved[at] = now if before is None else _MEMORY * before + (1.0 - _MEMORY) * now
        return found

    def state_dict(self) -> dict[str, Any]:
        """Return what was saved, and what the baseline saves."""
        return {"saved": list(self.saved), "baseline": list(self.baseline)}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore what ``state_dict`` returned."""
        self.saved, self.baseline = list(state["saved"]), tuple(state["baseline"])


def weighing(run_config: RunConfig, shares: Sequence[float]) -> Weighing | None:
    """Return the weights of a run's kinds, after the baseline has played; None if the shares are the weights."""
    if not isinstance(run_config.mixture, Mixture) or run_config.mixture.weigh == "share":
        return None
    names, baseline = [kind.name for kind in run_config.kinds], run_config.mixture.baseline
    found = baseline_results(
        run_config, [kind.world for kind in run_config.kinds], baseline, run_config.mixture.worlds, "saved"
    )
    values = ", ".join(f"{name} {value:.3f}" for name, value in zip(names, found, strict=True))
    log.info("mixture: %s saves of each kind: %s", baseline, values)
    return Weighing(run_config.mixture, names, shares, found)
