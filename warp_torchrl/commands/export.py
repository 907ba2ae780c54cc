"""Exports a trained policy: ``warp export RUN FOLDER``.

The folder holds a checkpoint without its training state. It can be evaluated, loaded and shipped; no run resumes from
it.

``--average OTHER`` gives it the mean of the parameters of both. Of a training and of what it started from, that is
often better than either (Wortsman et al. 2022, "Model soups"): docs/results.md.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import torch

from warp_torchrl.commands.program import flag_arguments, one_line_end
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.runs.export import export
from warp_torchrl.runs.history import history_line, mean_of
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.runs.policies.load import policy_of
from warp_torchrl.system.finite import not_finite
from warp_torchrl.system.flags import FlagParser


@one_line_end()
def main(arguments: list[str] | None = None) -> None:
    """Export the policy of the run or checkpoint that the command line names."""
    parser = FlagParser(prog="warp export", description=__doc__)
    told = "a run folder (its newest sound checkpoint), one of them, or the name of a shipped policy"
    parser.add_argument("run", metavar="RUN", help=told)
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="what to make")
    parser.add_argument("--trust", type=float, help="how much its agents trust their adviser from now on, model.trust")
    told = "how it acts from now on; else as was found at its training's end"
    parser.add_argument("--mode", choices=("sampled", "deterministic"), help=told)
    told = "others with the same networks, given as RUN is: it is the mean of all, weighed alike"
    parser.add_argument("--average", nargs="+", default=[], metavar="OTHER", help=told)
    options = parser.parse_args(flag_arguments(arguments))
    if options.folder.exists():
        parser.error(f"FOLDER must be new: {options.folder} exists")
    found, skipped = checkpoints.newest(find_policy(options.run))
    for line in skipped:
        print(f"skipped: {line}", file=sys.stderr)
    saved_config = found.saved_config()
    if options.trust is not None:
        saved_config = _trusting(saved_config, options.trust)
    if options.mode is not None:
        found = replace(found, manifest=replace(found.manifest, mode=options.mode))
    others = [checkpoints.newest(find_policy(each))[0] for each in options.average]
    policy = _mean([found, *others]) if others else None
    if others:
        history = mean_of([each.history for each in (found, *others)])
        found = replace(found, manifest=replace(found.manifest, history=history))
    export(found, options.folder, saved_config, policy, check=policy_of)
    told = f"{found.manifest.scenario}, {history_line(found.history)}, {found.manifest.mode}"
    print(f"{options.folder}: {told}")


def _mean(found: Sequence[checkpoints.Checkpoint]) -> dict[str, torch.Tensor]:
    """Return the mean of the parameters of policies.

    Raises:
        CheckpointError: If they differ in what they read, in what they write, or in their networks, or if a mean is
            not finite.
    """
    policies = [each.policy() for each in found]
    for checkpoint, policy in zip(found, policies):
        if _fits(checkpoint, policy) != _fits(found[0], policies[0]):
            told = f"{checkpoint.path} is of another architecture than {found[0].path}"
            raise checkpoints.CheckpointError(f"{told}: average a run with what it started from, or with its like")
    mean = {name: torch.stack([policy[name] for policy in policies]).mean(dim=0) for name in policies[0]}
    for name, value in mean.items():
        if not_finite(value) is not None:
            raise checkpoints.CheckpointError(f"the mean of {name} is not finite: its numbers are too large")
    return mean


def _fits(found: checkpoints.Checkpoint, policy: Mapping[str, torch.Tensor]) -> tuple[object, ...]:
    """Return what policies of a mean must share: their agents' inputs and actions, and the shapes of their networks."""
    signature = found.manifest.signature.bare()
    shapes = {name: value.shape for name, value in policy.items()}
    return signature.observation, signature.actions, signature.roles, signature.agencies, signature.is_late, shapes


def _trusting(saved_config: SavedConfig, trust: float) -> SavedConfig:
    """Return the configuration of a policy with another trust in its adviser."""
    return replace(
        saved_config, values={**saved_config.values, "model": {**saved_config.values["model"], "trust": trust}}
    )


if __name__ == "__main__":
    main()
