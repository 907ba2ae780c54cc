"""Worlds that were saved, read back."""

from torch import Tensor

from warp_torchrl.world.state.state import WorldState

_FORMER = {"wind": "air.wind"} | {
    f"landscape.{name}": f"ground.landscape.{name}" for name in ("cover", "age", "elevation", "assets", "corner")
}
"""Names of entries in runs that were saved before ground and air were made whole."""
_NO_LONGER = ("alpha", "slope", "gain", "chances", "tally")
"""What follows from the other entries, and was once saved beside them."""
_SINCE = tuple(f"ground.landscape.{name}" for name in ("fuel", "canopy_cover", "canopy_height"))
"""What landscapes once had not: worlds that were saved without it are read back without it."""


_BEGINS_NOW = "extras.sensing.watching."
"""Of entries that worlds of limited sight once had not: such worlds begin to count when they are read back."""


def filled(template: WorldState, entries: dict[str, Tensor]) -> WorldState:
    """Return worlds like a template with the entries that ``WorldState.what_changes`` once returned.

    Raises:
        ValueError: If an entry is missing, unknown, or of another shape or type.
    """
    kept = {name: value for name, value in entries.items() if name.split(".")[0] not in _NO_LONGER}
    entries = {_FORMER.get(name, name): value for name, value in kept.items()}
    template = _without(template, [name for name in _SINCE if name not in entries])
    expected = template.what_changes()
    entries = {name: value for name, value in expected.items() if name.startswith(_BEGINS_NOW)} | entries
    if set(expected) != set(entries):
        raise ValueError(f"worlds must have the entries {sorted(expected)}, got {sorted(entries)}")
    for name, value in entries.items():
        old = expected[name]
        if value.shape != old.shape or value.dtype != old.dtype:
            raise ValueError(f"{name} must be {old.dtype} {list(old.shape)}, got {value.dtype} {list(value.shape)}")
    given = {name: value.to(expected[name].device).clone() for name, value in entries.items()}
    return template.with_leaves({**template.leaves(), **given})


def _without(template: WorldState, names: list[str]) -> WorldState:
    """Return worlds whose landscapes lack the planes of these names."""
    landscape = template.landscape.replace(**{name.rpartition(".")[2]: None for name in names})
    return template.replace(ground=template.ground.replace(landscape=landscape))
