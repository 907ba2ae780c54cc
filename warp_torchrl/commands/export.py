"""Exports a trained policy: ``warp export POLICY FOLDER``; without FOLDER it prints the policy's card.

    warp export POLICY                             its card: trainings, use, failures, measurements
    warp export POLICY FOLDER                      a checkpoint without its training state
    warp export POLICY FOLDER format=safetensors   the same with the weights in policy.safetensors
    warp export POLICY FOLDER format=onnx          the actor of one vehicle: actor.onnx and actor.json
    warp export POLICY FOLDER format=torch_export  the same as actor.pt2, a program of torch.export

Each folder has the card. A checkpoint can be evaluated, loaded and shipped; no run resumes from it. An actor takes the
observation and the mask of one vehicle, and memory or messages where it has them; actor.json says what they hold.

    measured=[FOLDER, ...]   evaluations of this very policy that its manifest and card keep; that of its run is kept

``average=OTHER`` gives it the mean of the parameters of both policies. The mean of a trained policy and of the one that
its training started from often saves more than either (Wortsman et al. 2022, "Model soups").
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import torch

from warp_torchrl.commands.program import flag_arguments, one_line_end
from warp_torchrl.evaluation.reading import read_evaluation
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.grammar import own_values
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.runs.export import export
from warp_torchrl.runs.history import history_line, mean_of
from warp_torchrl.runs.measured import Measured, of_evaluation
from warp_torchrl.runs.policies.card import CARD, card
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.runs.policies.formats import FILES, check_format, export_actor
from warp_torchrl.runs.policies.load import policy_of
from warp_torchrl.system.finite import not_finite
from warp_torchrl.system.flags import FlagParser
from warp_torchrl.validation import did_you_mean

FORMATS = ("checkpoint", "safetensors", *FILES)
"""Formats of an export."""
EVALUATION = "evaluation.json"
"""File of an evaluation."""
_KEYS = ("format", "measured")


@one_line_end()
def main(arguments: list[str] | None = None) -> None:
    """Export the policy of the run or checkpoint that the command line names."""
    given = flag_arguments(arguments)
    own = [each for each in given if each.partition("=")[0] in _KEYS]
    values, _ = own_values(own, _KEYS)
    parser = _parser()
    options = parser.parse_args([each for each in given if each not in own])
    format = _format(values.get("format", "checkpoint"), options)
    if options.folder is not None and options.folder.exists():
        parser.error(f"FOLDER must be new: {options.folder} exists")
    path = find_policy(options.run)
    found, skipped = checkpoints.newest(path)
    for line in skipped:
        print(f"skipped: {line}", file=sys.stderr)
    others = [checkpoints.newest(find_policy(each))[0] for each in options.average]
    found = _changed(found, options.mode, options.trust, others, _evaluations(values.get("measured"), path, found))
    if options.folder is None:
        print(card(found, Path(options.run).name), end="")
        return
    if format in FILES:
        difference = export_actor(found, options.folder, format)
        print(f"{options.folder}: {FILES[format]}, actions as of the policy, logits within {difference:.0e}")
        return
    saved_config = None if options.trust is None else _trusting(found.saved_config(), options.trust)
    policy = _mean([found, *others]) if others else None
    export(
        found,
        options.folder,
        saved_config,
        policy,
        check=policy_of,
        write=lambda draft, made: (draft / CARD).write_text(card(made, options.folder.name), encoding="utf-8"),
        is_safe=format == "safetensors",
    )
    told = f"{found.manifest.scenario}, {history_line(found.history)}, {found.manifest.mode}"
    print(f"{options.folder}: {told}")


def _parser() -> FlagParser:
    parser = FlagParser(prog="warp export", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    told = "a run folder (its newest sound checkpoint), one of them, the name of a shipped policy, or hf://OWNER/NAME"
    parser.add_argument("run", metavar="POLICY", help=told)
    parser.add_argument("folder", type=Path, nargs="?", metavar="FOLDER", help="what to make; none prints the card")
    parser.add_argument("--trust", type=float, help="how much its agents trust their adviser from now on, model.trust")
    told = "how it acts from now on; else as was found at its training's end"
    parser.add_argument("--mode", choices=("sampled", "deterministic"), help=told)
    told = "others with the same networks, given as POLICY is: it is the mean of all, weighed alike"
    parser.add_argument("--average", nargs="+", default=[], metavar="OTHER", help=told)
    return parser


def _format(given: object, options: argparse.Namespace) -> str:
    """Return the format, checked against what else is asked.

    Raises:
        ConfigError: If it is unknown, needs what is not installed, or does not go with a flag.
    """
    format = str(given)
    if format not in FORMATS:
        raise ConfigError(f"format must be one of {', '.join(FORMATS)}, got {format}{did_you_mean(format, FORMATS)}")
    changes = options.average or options.trust is not None or options.mode is not None
    if format in FILES and (changes or options.folder is None):
        what = "trust, mode and average make a checkpoint: export that first" if changes else "FOLDER must be given"
        raise ConfigError(f"{what}, then with format={format}" if changes else f"{what} with format={format}")
    check_format(format)
    return format


def _changed(
    found: checkpoints.Checkpoint,
    mode: str | None,
    trust: float | None,
    others: Sequence[checkpoints.Checkpoint],
    measured: Sequence[Measured],
) -> checkpoints.Checkpoint:
    """Return the checkpoint with the manifest of what is exported; what was measured is of the policy unchanged."""
    of = found.manifest
    history = mean_of([each.history for each in (found, *others)]) if others else found.history
    is_other = bool(others) or trust is not None or mode not in (None, of.mode)
    results = {each.worlds: each for each in (*(() if is_other else of.measured), *measured)}
    manifest = replace(of, mode=mode or of.mode, history=history, measured=tuple(results.values()))
    return replace(found, manifest=manifest)


def _evaluations(given: object, path: Path, found: checkpoints.Checkpoint) -> list[Measured]:
    """Return the results in folders of evaluations, and in a run's own if it is of this checkpoint.

    Raises:
        ConfigError: If one holds no evaluation.
    """
    if given is not None and not isinstance(given, list):
        raise ConfigError(f"measured must be a list of folders, measured=[{given}], got {given}")
    files = [Path(str(folder)) / EVALUATION for folder in (given or ())]
    own = path / EVALUATION
    results = []
    try:
        if own.is_file():
            result, frames = _result(own)
            results = [result] if frames == found.manifest.frames else []
    except ConfigError as error:
        print(f"skipped: {error}", file=sys.stderr)
    return [*results, *(_result(file)[0] for file in files)]


def _result(path: Path) -> tuple[Measured, object]:
    """Return the result in an evaluation, and the frames of its policy.

    Raises:
        ConfigError: If it is no evaluation.
        OSError: If it cannot be opened.
    """
    content = read_evaluation(path)
    try:
        return of_evaluation(content), content.get("frames")
    except (KeyError, TypeError, ValueError):
        raise ConfigError(f"{path} is no evaluation with means, intervals and baselines") from None


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
