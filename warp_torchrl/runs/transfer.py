"""Start of a run from another run's learned parameters."""

from collections.abc import Mapping

from torch import Tensor
from torchrl.objectives import LossModule

from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.algorithms.on_policy import OnPolicy
from warp_torchrl.runs.checkpoint import Checkpoint, CheckpointError
from warp_torchrl.runs.config.run_config import RunConfig


def check_start(run_config: RunConfig, found: Checkpoint) -> None:
    """Check that training can start from another run's learned parameters.

    Raises:
        CheckpointError: If the checkpoint has another kind of loss or other networks, or is an exported policy and
            the algorithm replays.
    """
    if not isinstance(run_config.algorithm, OnPolicy):
        found.check_goes_on()
    symmetry = getattr(run_config.model, "symmetry", "none")  # networks of either have the same names and shapes
    theirs = found.saved_config().values.get("model", {}).get("symmetry", "none")
    if theirs != symmetry:
        raise _other_networks(found, "model.symmetry", theirs, symmetry)
    batch = run_config.collector.steps * run_config.n_worlds
    learner = run_config.algorithm.build(run_config.make_env(1, 0), run_config.model, batch)
    if found.goes_on:
        learned_parameters(found, learner.loss)
    else:
        actor_parameters(found, learner)


def actor_parameters(found: Checkpoint, learner: Learner) -> dict[str, Tensor]:
    """Return the parameters of an exported policy, by the names of a learner's policy.

    Raises:
        CheckpointError: If their names or shapes differ.
    """
    now = learner.policy.state_dict()
    given = found.policy()
    _check_alike(found, now, given)
    return given


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
    theirs, ours = ({name: list(each.shape) for name, each in state.items()} for state in (given, own))
    for name in {**ours, **theirs}:
        if theirs.get(name) != ours.get(name):
            raise _other_networks(found, name, theirs.get(name, "missing"), ours.get(name, "missing"))


def _other_networks(found: Checkpoint, what: str, there: object, here: object) -> CheckpointError:
    return CheckpointError(
        f"{found.path} was trained by another algorithm or other networks, or its agents see more or less: "
        f"{what} is {there} there, {here} here"
    )
