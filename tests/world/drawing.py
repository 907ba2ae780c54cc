"""Small worlds drawn by hand as text.

A map is rows of one character a cell, with white space between rows:

    .  empty ground     1..9  tree of that age     T  tree of age 10
    ~  lake             #     firebreak            a b c d e  fire, codes 11..15

The ground under it is grassland, or drawn the same way: ~ lake, w wetland, g grassland, f forest, b bare.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.arrays.random import world_key
from warp_torchrl.world.backends.tick import initial_state
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.records import KNOWLEDGE
from warp_torchrl.world.state.state import Cover, Landscape, WorldState
from warp_torchrl.world.team.team import Team

CELLS = ".123456789Tabcde"
GROUND = "~wgfb"
LAKE, FIREBREAK = "~", "#"


def codes(drawing: str, alphabet: str) -> Tensor:
    """Return the place of each character in the alphabet, uint8 [H, W]; 0 for one that is not in it."""
    return torch.tensor([[max(0, alphabet.find(cell)) for cell in row] for row in drawing.split()], dtype=torch.uint8)


def tiled(drawing: str, down: int, across: int) -> str:
    """Return the drawing repeated, ``down`` times by ``across``."""
    return " ".join([row * across for row in drawing.split()] * down)


def marks(drawing: str, mark: str) -> Tensor:
    """Return where a character stands, bool [H, W]."""
    return torch.tensor([[cell == mark for cell in row] for row in drawing.split()])


def drawn_cover(drawing: str, ground: str = "") -> Tensor:
    """Return the land cover, uint8 [H, W]: as ``ground`` has it, or grassland with the lakes of the drawing."""
    if ground:
        return codes(ground, GROUND)
    return torch.where(marks(drawing, LAKE), Cover.LAKE, Cover.GRASSLAND).to(torch.uint8)


def draw(
    drawing: str,
    *,
    ground: str = "",
    fire: Fire | None = None,
    elevation: list[list[float]] | None = None,
    wind: tuple[float, float] | Tensor = (0.0, 0.0),
    team: Team | None = None,
    at: list[tuple[int, int]] | None = None,
    age_on_fire: int = 10,
    worlds: int = 1,
    seed: int = 0,
) -> WorldState:
    """Return ``worlds`` worlds like the drawing, with seeds from ``seed`` on, in which fires burn already.

    Args:
        drawing: The cells.
        ground: The land cover, if it is not all grassland.
        fire: The automaton that sets flammability and slope factors.
        elevation: [H, W] [m].
        wind: (u, v) over the whole map, or a field [2, H, W] [m/s].
        team: The vehicles; one bulldozer unless given.
        at: (row, column) of each vehicle; the north-west corner unless given.
        age_on_fire: Age of the burning trees when they caught fire.
        worlds: How many.
        seed: Of the first.
    """
    fire, team = fire or Fire(), team or Team(n_agents=1)
    cells, cover = codes(drawing, CELLS), drawn_cover(drawing, ground)
    burning = cells > 10
    key = world_key(torch.arange(seed, seed + worlds), torch.zeros(worlds, dtype=torch.int64))

    def in_each(plane: Tensor) -> Tensor:
        return plane.expand(worlds, *plane.shape).contiguous()

    air = wind if isinstance(wind, Tensor) else torch.tensor(wind)[:, None, None]
    height = None if elevation is None else in_each(torch.tensor(elevation, dtype=torch.float32))
    trees = torch.where(burning, age_on_fire, cells)
    land = Landscape(cover=in_each(cover), age=in_each(trees), elevation=height)
    vehicles = team.place(key, land.cover, in_each(burning))
    places = torch.tensor(at or [(0, 0)] * team.n_agents)
    vehicles = vehicles.replace(position=in_each(places))
    state = initial_state(land, fire, air.expand(worlds, *air.shape), key, vehicles, 30.0)
    return state.replace(
        cells=in_each(cells),
        age=in_each(trees * burning),
        firebreak=in_each(marks(drawing, FIREBREAK)),
    )


@dataclass(eq=False, repr=False)
class Records(Batch):
    """Records, and nothing beside."""

    records: Tensor  # int32 [B,A,H,W]


def knowing(state: WorldState, records: Tensor) -> WorldState:
    """Return the worlds whose agents have these records of the fire, int32 [B, A, H, W]."""
    held = state.extras.held.get(KNOWLEDGE)
    return state.with_planes(KNOWLEDGE, Records(records) if held is None else held.replace(records=records))


def drawn(state: WorldState, world: int = 0) -> str:
    """Return the cells of one world as a drawing of one line, rows apart by a space; lakes and firebreaks are '.'."""
    return " ".join("".join(CELLS[code] for code in row) for row in state.cells[world].tolist())


def differing(state: WorldState, other: WorldState) -> list[str]:
    """Return the names of the tensors that are not the same bit for bit."""
    theirs = other.leaves()
    return [name for name, plane in state.leaves().items() if not torch.equal(plane, theirs[name])]
