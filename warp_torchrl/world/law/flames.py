"""Flames of the front that goes out from a cell, by the way that it goes, under law ``rate``.

Byram's intensity is I = H w R. The heat H w of an area follows from fuel and moisture, the rate R from the way:

    I = (I_head / R_head) R,    R = 1 / (a - w . u)

u is the unit vector of the way; a and w are those of ``world.law.travel``. So flames are long at the head of a fire and
short at its flanks and rear. Where that matters to the bit there are sums, products and roots alone.
"""

import torch
from torch import Tensor
from torch.nn.functional import pad

from warp_torchrl.world.arrays.constants import numbers
from warp_torchrl.world.arrays.geometry import DIRECTIONS, offsets
from warp_torchrl.world.arrays.listing import filled
from warp_torchrl.world.law import arrivals
from warp_torchrl.world.law.automaton import at_cells
from warp_torchrl.world.law.cells import is_burning
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.law.travel import Metric
from warp_torchrl.world.state.state import WorldState

_LEAST = 1e-9
_SECONDS = 60.0  # in a minute
_LONGEST = 255  # decimetres, of a byte


def heat_of(fire: RateFire, state: WorldState) -> Tensor:
    """Return the heat that fire would release on each area in the weather of now, float32 [B, H, W] [kJ/m2].

    60 I_head / R_head
    """
    count = state.cells[0].numel()
    cells = torch.arange(filled(count), device=state.cells.device).clamp(max=count - 1)
    spread = fire.head_at(state, cells.expand(len(state.cells), -1))
    heat = torch.where(spread.head > _LEAST, _SECONDS * spread.intensity / spread.head.clamp(min=_LEAST), 0.0)
    return heat.flatten(1)[:, :count].reshape(state.alpha.shape)


def metric_at(state: WorldState, cell: Tensor) -> Metric:
    """Return a, w_east and w_north of the fire in some cells, int64 [B, n], float32 [B, n] each [minutes a cell]."""
    flat = cell + torch.arange(0, state.cells.numel(), state.cells[0].numel(), device=cell.device)[:, None]
    slowness, east, north = (
        each.view(cell.shape) for each in arrivals.metric_at(state.ground, state.air, flat.flatten())
    )
    return slowness, east, north


def intensity(heat: Tensor, metric: Metric, east: Tensor, north: Tensor, cell_size: float) -> Tensor:
    """Return the intensity of fronts that go some way, float32 of one shape [kW/m].

    Args:
        heat: Of an area [kJ/m2].
        metric: Of the fire there.
        east: Of the way, any length; where there is none, to the east nor to the north, it is that of the head.
        north: Of the way.
        cell_size: Side of a cell [m].
    """
    slowness, drift_east, drift_north = metric
    length = torch.sqrt(east * east + north * north)
    along = (drift_east * east + drift_north * north) / length.clamp(min=_LEAST)
    strongest = torch.sqrt(drift_east * drift_east + drift_north * drift_north)
    time = slowness - torch.where(length > 0.0, along, strongest)
    return heat * cell_size / (_SECONDS * time.clamp(min=_LEAST))


def front_towards(state: WorldState, heat: Tensor | None, alike: float, cell: Tensor, place: Tensor) -> Tensor:
    """Return the intensity of the fronts that go from cells to places, float32 [B, n] [kW/m].

    Args:
        state: The worlds.
        heat: See ``heat_of``; None under laws without intensity.
        alike: Intensity of all fire under these [kW/m].
        cell: Flat index, int64 [B, n].
        place: (row, column) of each, int64 [B, n, 2]; that of the cell itself gives the head's.
    """
    if heat is None:
        return torch.full(cell.shape, alike, device=cell.device)
    width, (row, column) = state.cells.shape[2], place.unbind(-1)
    east, north = column - cell % width, cell.div(width, rounding_mode="floor") - row
    ways = east.to(heat.dtype), north.to(heat.dtype)
    return intensity(at_cells(heat, cell), metric_at(state, cell), *ways, state.ground.cell_size)


def strongest_into(state: WorldState, heat: Tensor | None, alike: float, cell: Tensor) -> Tensor:
    """Return the intensity of the strongest front that would come from a burning neighbour, float32 [B, n] [kW/m].

    0 where none burns. The arguments are those of ``front_towards``.
    """
    (height, width), away = state.cells.shape[1:], offsets(cell.device)
    row = cell.div(width, rounding_mode="floor")[..., None] + away[:, 0]
    column = (cell % width)[..., None] + away[:, 1]
    inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    index = row.clamp(0, height - 1) * width + column.clamp(0, width - 1)
    burns = is_burning(at_cells(state.cells, index.flatten(1))).view_as(inside) & inside
    if heat is None:
        return burns.any(dim=-1) * alike
    south, east = (each.expand(inside.shape) for each in away.to(heat.dtype).unbind(1))
    slowness, drift_east, drift_north = (each[..., None] for each in metric_at(state, cell))
    own = at_cells(heat, cell)[..., None]
    strong = intensity(own, (slowness, drift_east, drift_north), -east, south, state.ground.cell_size)
    return (strong * burns).amax(dim=-1)


def weakest_way_out(state: WorldState, heat: Tensor, is_way: Tensor, cell: Tensor) -> Tensor:
    """Return the least intensity of a front that leaves some cells, float32 [N] [kW/m]; inf where no way is open.

    Args:
        state: The worlds.
        heat: See ``heat_of``.
        is_way: Which cells a front may leave to, bool [B, H, W].
        cell: Flat indices in [B, H, W], int64 [N].
    """
    _, height, width = state.cells.shape
    metric, own = arrivals.metric_at(state.ground, state.air, cell), heat.flatten().index_select(0, cell)
    line = cell.div(width, rounding_mode="floor")  # of all maps; with margins each map has two more
    place = (line + 2 * line.div(height, rounding_mode="floor") + 1) * (width + 2) + cell % width + 1
    ways = pad(is_way, (1, 1, 1, 1)).flatten()
    least = torch.full_like(own, torch.inf)
    for down, right in DIRECTIONS:
        is_open = ways.index_select(0, place + down * (width + 2) + right)
        way = torch.full_like(own, right), torch.full_like(own, -down)
        least = torch.where(is_open, torch.minimum(least, intensity(own, metric, *way, state.ground.cell_size)), least)
    return least


def flames_of(intensity: Tensor) -> Tensor:
    """Return the flame length of an intensity [kW/m], L = 0.0775 I^0.46 (Byram 1959), float32 [m].

    It is cut to whole decimetres, which are looked up: powers round otherwise at the end of a batch.
    """
    bounds = tuple((0.1 * step / 0.0775) ** (1.0 / 0.46) for step in range(1, _LONGEST + 1))
    return torch.bucketize(intensity, numbers(bounds, intensity.device), right=True) * 0.1
