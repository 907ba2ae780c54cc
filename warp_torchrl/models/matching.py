"""Parameters of networks for networks that see other channels or numbers, matched by name."""

from collections.abc import Mapping

from torch import Tensor, nn

from warp_torchrl.models.networks import ConvolutionalEncoder, LinearEncoder
from warp_torchrl.models.signature import Entry


def first_weights(module: nn.Module) -> dict[str, Entry]:
    """Return what each weight that reads an observation reads, by the weight's name."""
    return {
        f"{name}.{weight}": entry
        for name, each in module.named_modules()
        if isinstance(each, LinearEncoder | ConvolutionalEncoder)
        for weight, entry in each.first_weights().items()
    }


def matched(parameters: Mapping[str, Tensor], trained: nn.Module, here: nn.Module) -> dict[str, Tensor]:
    """Return parameters of trained networks for networks of the same kind that see more, less, or in another order.

    Where a channel or number has the same name, it has the same weights. What is new weighs 0, so that the networks do
    at first what the trained ones do; what is no longer seen is left out. Entries without names, and of other sizes of
    map, stay as they are.

    Args:
        parameters: Of the trained networks, by name.
        trained: Networks with these names; their parameters may be on the meta device.
        here: The networks that see otherwise.
    """
    theirs, found = first_weights(trained), dict(parameters)
    for name, entry in first_weights(here).items():
        before = theirs.get(name)
        if before is not None and _is_renamed(before, entry):
            found[name] = _matched(parameters[name], before, entry)
    return found


def differences(trained: nn.Module, here: nn.Module) -> tuple[list[str], list[str]]:
    """Return the names that are new to trained networks, and those that they no longer see, each in order."""
    theirs, ours = first_weights(trained), first_weights(here)
    pairs = [(set(theirs[weight].names), set(entry.names)) for weight, entry in ours.items() if weight in theirs]
    new, left = ({name for one, two in pairs for name in two - one}, {name for one, two in pairs for name in one - two})
    return sorted(new), sorted(left)


def _is_renamed(trained: Entry, here: Entry) -> bool:
    """Return whether two entries differ in their names alone, and by these in their first dimension."""
    named = bool(trained.names and here.names) and trained.names != here.names
    return named and trained.shape[1:] == here.shape[1:] and trained.dtype == here.dtype


def _matched(weight: Tensor, trained: Entry, here: Entry) -> Tensor:
    """Return the weights [out, channels, K, K], or flat [out, numbers], over an entry by those over a trained one."""
    is_flat = weight.dim() == 2
    by_name = weight.unflatten(1, (len(trained.names), -1)) if is_flat else weight
    known = [name for name in here.names if name in trained.names]
    wide = by_name.new_zeros(len(weight), len(here.names), *by_name.shape[2:])
    wide[:, [here.names.index(name) for name in known]] = by_name[:, [trained.names.index(name) for name in known]]
    return wide.flatten(1) if is_flat else wide
