"""Minutes of arrival on the whole map, of fires without vehicles."""

from collections.abc import Iterator, Sequence

from torch import Tensor

from warp_torchrl.world.fires.alone import Burned, Fires
from warp_torchrl.world.fires.spell import Spell
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import NEVER
from warp_torchrl.world.state.state import Landscape


def arrival_minutes(
    fire: RateFire,
    landscape: Landscape,
    lit: Tensor,
    key: Tensor,
    spells: Sequence[Spell],
    cell_size: float,
) -> Iterator[Tensor]:
    """Return when each fire reaches each cell, some fires at a time.

    Args:
        fire: The automaton.
        landscape: One landscape, batch size [1].
        lit: The cells that burn at minute 0, bool [H, W], or of each fire [B, H, W].
        key: Of the fires, int64 [B]: their draws of rates.
        spells: The weather.
        cell_size: Side of a cell [m].

    Yields:
        float32 [b, H, W] [minutes], in order; ``travel.NEVER`` where the fire does not come.
    """
    fires = Fires(fire=fire, landscape=landscape, spells=spells, cell_size=cell_size)
    yield from fires.in_parts(lit, key, on_map)


def on_map(burned: Burned) -> Tensor:
    """Return the minutes on the whole map, float32 [b, H, W]."""
    if burned.window.is_whole:
        return burned.minutes.clone()
    plane = burned.minutes.new_full((len(burned.minutes), *burned.window.map), NEVER)
    return burned.window.put(burned.minutes, plane)
