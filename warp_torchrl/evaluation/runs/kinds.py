"""Forest saved in the last evaluation of each run in training, by kind of worlds, beside other runs of one seed."""

from collections.abc import Mapping, Sequence

import numpy as np

from warp_torchrl.evaluation.runs.curves import Line
from warp_torchrl.evaluation.runs.folders import Run
from warp_torchrl.evaluation.runs.markdown import markdown

EVALUATED = "evaluation/saved"


def last_evaluation(run: Run) -> dict[str, float]:
    """Return the share of the forest that a run saved when it was last evaluated in training.

    Args:
        run: With ``evaluation/saved``, and of a mixture ``evaluation/saved_KIND`` of each kind.

    Returns:
        Mean share of the initial trees: ``all``, the mean over kinds, and each kind by name.

    Raises:
        ValueError: If the run has not been evaluated.
    """
    found = run.rows.get(EVALUATED, np.empty(0))
    known = np.isfinite(found).nonzero()[0]
    if not len(known):
        raise ValueError(f"{run.folder / 'metrics.csv'} has no evaluation in training: evaluation.interval makes them")
    shares = {name: float(values[known[-1]]) for name, values in run.rows.items() if name.startswith(EVALUATED)}
    return {name.removeprefix(EVALUATED).removeprefix("_") or "all": share for name, share in shares.items()}


def kinds_table(lines: Sequence[Line]) -> str:
    """Return a Markdown table, a row for each line: what its runs save [%] of all kinds of worlds and of each, in the
    mean, and how much more each saves of all than the first line's run of its seed.

    Raises:
        ValueError: If a run has not been evaluated.
    """
    found = [[last_evaluation(run) for run in line.runs] for line in lines]
    names = list(dict.fromkeys(name for runs in found for shares in runs for name in shares))
    first, rows = _by_seed(lines[0], found[0]), []
    for line, runs in zip(lines, found, strict=True):
        own = _by_seed(line, runs)
        gaps = [f"{100.0 * (own[seed] - first[seed]):+.1f}" for seed in first if seed in own and line is not lines[0]]
        rows.append([line.label, *(_mean(runs, name) for name in names), ", ".join(gaps)])
    return markdown(["saved in evaluation, %", *names, "more than the first, seed by seed"], rows)


def _by_seed(line: Line, runs: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return what runs save of all kinds, by their seeds; not of those whose seed is not recorded."""
    pairs = zip(line.runs, runs, strict=True)
    return {run.seed: shares["all"] for run, shares in pairs if run.seed is not None}


def _mean(runs: Sequence[Mapping[str, float]], name: str) -> str:
    """Return the mean of the runs that were evaluated on a kind."""
    there = [shares[name] for shares in runs if name in shares]
    return f"{100.0 * float(np.mean(there)):.1f}" if there else "-"
