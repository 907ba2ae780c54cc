"""Start of a run from another run's learned parameters."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn
from torchrl.objectives import LossModule

from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.algorithms.on_policy import OnPolicy
from warp_torchrl.models import Entry, Signature, signature
from warp_torchrl.models.matching import differences, matched
from warp_torchrl.runs.checkpoint import Checkpoint, CheckpointError
from warp_torchrl.runs.config.run_config import RunConfig


class OtherNetworksError(CheckpointError):
    """A checkpoint has other networks, or its agents see something else: keys of observation and model mend it."""


class Start(NamedTuple):
    """What a training starts with."""

    part: nn.Module  # of the learner: its loss, or its policy alone
    parameters: dict[str, Tensor]  # of the whole part, by name
    notes: tuple[str, ...]  # what the log tells


def check_start(run_config: RunConfig, found: Checkpoint) -> None:
    """Check that training can start from another run's learned parameters.

    Raises:
        OtherNetworksError: If the checkpoint has other networks, entries or symmetry; where the algorithm replays,
            also if agents see something else.
        CheckpointError: If it has another kind of loss, other actions, or roles or agencies of networks; where the
            algorithm replays, also if it is an exported policy.
    """
    batch, env = run_config.collector.steps * run_config.n_worlds, run_config.make_env(1, 0)
    start_of(found, run_config, run_config.algorithm.build(env, run_config.model, batch), signature(env))


def start_of(found: Checkpoint, run_config: RunConfig, learner: Learner, here: Signature) -> Start:
    """Return what a learner starts with from another run.

    All that was learned, where agents and critic see what they saw there; else, and from an exported policy, the policy
    alone, with what agents see matched by name, see ``matched``.

    Args:
        found: The other run's checkpoint.
        run_config: Of the training that starts.
        learner: Its learner.
        here: Signature of its environment.

    Raises:
        CheckpointError: As of ``check_start``.
    """
    algorithm, trained = run_config.algorithm, found.manifest.signature
    replays = not isinstance(algorithm, OnPolicy)
    if replays:
        found.check_goes_on()
    _check_kind(found, run_config.model, here)
    seen = [_seen(one, getattr(algorithm, "central_critic", True)) for one in (trained, here)]
    if replays:
        for name, entry in seen[0].items():
            _check_same(found, f"the names of {name}", _joined(entry.names), _joined(seen[1][name].names))
    if found.goes_on and (replays or seen[0] == seen[1]):
        loss = learner.loss
        return Start(loss, {**loss.state_dict(), **learned_parameters(found, loss)}, ())
    other = ", ".join(name or "observation" for name in seen[1] if seen[0].get(name) != seen[1][name])
    notes = [f"start_from: the critic starts fresh, for {other} is not as it was there"] if found.goes_on else []
    policy, given = learner.policy, found.policy()
    before = _networks_of(run_config, trained)
    if before is not None and _shapes(before.state_dict()) == _shapes(given):
        given = matched(given, before, policy)
        notes += _told(*differences(before, policy))
    _check_alike(found, policy.state_dict(), given)
    return Start(policy, given, tuple(notes))


def _check_kind(found: Checkpoint, model: Any, here: Signature) -> None:
    """Check that symmetry, actions, entries, and the roles or agencies of networks are those of a checkpoint."""
    trained, sharing = found.manifest.signature, getattr(model, "sharing", "team")
    symmetry = getattr(model, "symmetry", "none")  # networks of either have the same names and shapes
    theirs = found.saved_config().values.get("model", {}).get("symmetry", "none")
    _check_same(found, "model.symmetry", theirs, symmetry)
    _check_same(found, "actions", _joined(trained.actions), _joined(here.actions), CheckpointError)
    _check_same(found, "observation", _joined(trained.observation), _joined(here.observation))
    if sharing == "role":
        _check_same(found, "roles", _joined(trained.roles), _joined(here.roles), CheckpointError)
    if sharing == "agency":
        _check_same(found, "agencies", _joined(trained.agencies), _joined(here.agencies), CheckpointError)


def _networks_of(run_config: RunConfig, trained: Signature) -> nn.Module | None:
    """Return the policy that a run would have of what was seen there, without memory; None where it can have none.

    Trust has no parameters, and needs an adviser that may be new.
    """
    model = run_config.model
    for each in (model, *([replace(model, trust=0.0)] if getattr(model, "trust", 0.0) else [])):
        try:
            with torch.device("meta"):
                return run_config.algorithm.policy(trained, each)
        except ValueError:  # of what the model needs, and was not seen there
            continue
    return None


def _seen(signature: Signature, state: bool) -> dict[str, Entry]:
    """Return what networks read, by name: the observation, and the critic's state where it reads that."""
    bare = signature.bare()
    return {**bare.observation, **({"state": bare.state} if state else {})}


def _joined(names: Iterable[str]) -> str:
    return ", ".join(names)


def _told(new: list[str], left: list[str]) -> Iterator[str]:
    """Yield lines that tell what agents see that the policy did not, and the other way round."""
    if new:
        yield f"start_from: the policy learns to see {', '.join(new)}, which weigh nothing at first"
    if left:
        yield f"start_from: the policy no longer sees {', '.join(left)}"


def learned_parameters(found: Checkpoint, loss: LossModule) -> dict[str, Tensor]:
    """Return the networks' parameters and the value normalisation of a checkpoint's loss, by name.

    Raises:
        CheckpointError: If their names or shapes differ from this loss's.
    """
    own, given = (
        {name: each for name, each in state.items() if _is_learned(name)}
        for state in (loss.state_dict(), found.training()["loss"])
    )
    _check_alike(found, own, given)
    return given


def _is_learned(name: str) -> bool:
    """Return whether an entry of a loss's state is a parameter or the value normalisation, not a setting."""
    return "_params." in name or name.startswith("value_norm.")


def _check_alike(found: Checkpoint, own: Mapping[str, Tensor], given: Mapping[str, Tensor]) -> None:
    """Check that networks have the names and shapes of a checkpoint's."""
    theirs, ours = _shapes(given), _shapes(own)
    for name in {**ours, **theirs}:
        _check_same(found, name, theirs.get(name, "missing"), ours.get(name, "missing"))


def _shapes(parameters: Mapping[str, Tensor]) -> dict[str, list[int]]:
    return {name: list(each.shape) for name, each in parameters.items()}


def _check_same(
    found: Checkpoint, what: str, there: object, here: object, refusal: type[CheckpointError] = OtherNetworksError
) -> None:
    """Check that something is here as it was there.

    Raises:
        CheckpointError: If it is not, as the given refusal.
    """
    if there != here:
        raise refusal(
            f"{found.path} was trained by another algorithm or other networks, or its agents see more or less: "
            f"{what} is {there} there, {here} here"
        )
