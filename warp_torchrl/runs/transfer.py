"""What a run that begins with another one's networks takes over."""

from torch import Tensor
from torchrl.objectives import LossModule

from warp_torchrl.config.compose import plain, recompose
from warp_torchrl.config.settings import Settings
from warp_torchrl.models import Mlp
from warp_torchrl.runs import former
from warp_torchrl.runs.checkpoint import Checkpoint, CheckpointError


def check_start(settings: Settings, found: Checkpoint) -> None:
    """Check that training can begin with another run's networks, before anything is made for it.

    Raises:
        CheckpointError: If it is a policy alone, or was trained by another kind of loss or other networks.
    """
    found.check_goes_on()
    batch = settings.collector.steps * settings.n_worlds
    learnt(found, settings.algorithm.build(settings.make_env(1, 0), settings.model, batch).loss, settings.model)


def learnt(found: Checkpoint, loss: LossModule, model: Mlp) -> dict[str, Tensor]:
    """Return what a checkpoint's loss has learnt, the state of networks and of value normalisation, by name.

    Raises:
        CheckpointError: If it does not fit this loss.
    """
    now = loss.state_dict()
    own, given = (
        {name: each for name, each in state.items() if _is_learnt(name)}
        for state in (now, former.parameters(found.training()["loss"], now))
    )
    symmetry = plain(recompose(found.record()))["model"]["symmetry"]  # networks of all have the same parameters
    shapes, others = ({name: each.shape for name, each in state.items()} for state in (own, given))
    if shapes != others or symmetry != model.symmetry:
        raise CheckpointError(f"{found.path} was trained by another algorithm or other networks")
    return given


def _is_learnt(name: str) -> bool:
    """Return whether an entry of a loss's state is a parameter or the running scale of values, and not a setting."""
    return "_params." in name or name.startswith("value_norm.")
