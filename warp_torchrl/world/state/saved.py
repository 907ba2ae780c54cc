"""Worlds that were saved, read back."""

from torch import Tensor

from warp_torchrl.world.state.state import WorldState


def filled(template: WorldState, entries: dict[str, Tensor]) -> WorldState:
    """Return worlds like a template with the entries that ``WorldState.what_changes`` once returned.

    Raises:
        ValueError: If an entry is missing, unknown, or of another shape or type.
    """
    expected = template.what_changes()
    if set(expected) != set(entries):
        raise ValueError(f"worlds must have the entries {sorted(expected)}, got {sorted(entries)}")
    for name, value in entries.items():
        old = expected[name]
        if value.shape != old.shape or value.dtype != old.dtype:
            raise ValueError(f"{name} must be {old.dtype} {list(old.shape)}, got {value.dtype} {list(value.shape)}")
    given = {name: value.to(expected[name].device).clone() for name, value in entries.items()}
    return template.with_leaves({**template.leaves(), **given})
