"""Hidden fires: where one may burn that nobody has seen, drawn from the scenario's ignition and struck out by sight."""

import math
from dataclasses import replace

import torch
from torch import Tensor

from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.world.arrays.batch import Named
from warp_torchrl.world.arrays.geometry import grow
from warp_torchrl.world.arrays.random import Stream, named_key, uniform
from warp_torchrl.world.ensemble.members import held, lit, ticked, unburned, worlds_of
from warp_torchrl.world.ignition.ignition import Ignition, IgnitionSource
from warp_torchrl.world.mechanics.belief.beliefs import NAME, Beliefs, cells_of
from warp_torchrl.world.mechanics.belief.sightings import Sightings
from warp_torchrl.world.mechanics.mechanic import Rules
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.state import WorldState

DOUBT = 0.3
"""Factor on how likely a hidden fire is, for each cell that is seen to be otherwise: fires of one place differ."""
_APART = 3
"""Fire that is seen farther than this from all known fire is another one [cells]."""


def fires_lit(lighting: IgnitionSource) -> int:
    """Return how many fires an ignition lights, as far as it says."""
    return lighting.count if isinstance(lighting, Ignition) else 1


def hidden_fires(state: WorldState, world: Rules, keys: Tensor) -> Named:
    """Return single fires of the scenario's ignition, after its head start.

    Args:
        state: The true worlds.
        world: Their rules.
        keys: Of the draws, int64 [B, M].
    """
    lighting, fire, count = world.lighting, world.fire, keys.shape[1]
    one = replace(lighting, count=1) if isinstance(lighting, Ignition) else lighting
    worlds = worlds_of(state, unburned(state, keys, fire), fire)
    fuel = (worlds.landscape.age >= fire.youngest_fuel) & (worlds.alpha > 0.0)
    worlds = lit(worlds.replace(tick=torch.zeros_like(worlds.tick)), one(worlds.key, fuel), fire)
    for _ in range(lighting.head_start):
        worlds = ticked(worlds, fire, world.air, torch.ones_like(worlds.done), worlds.air)
    return held(worlds, count, fire)


def struck(state: WorldState, beliefs: Beliefs, seen: Sightings, doubt: float, recent: Tensor) -> Beliefs:
    """Return beliefs whose hidden fires are as likely as what is seen leaves them.

    A hidden fire that burns or has burned where a tree is seen is less likely by ``doubt`` for each such cell; one that
    burns where fire is seen is found, and hidden no more. Fire that is seen far from all that is known is another one.

    Args:
        state: The worlds.
        beliefs: What is believed.
        seen: What is seen.
        doubt: Factor on how likely a hidden fire is.
        recent: Cells that were seen lately, bool [B, G, H, W].
    """
    code = seen.of(beliefs.hidden.held["cells"][:, None])
    says, gone = is_burning(code), seen.of(beliefs.hidden.held["burned"][:, None])
    there, burns = seen.there[:, :, None], seen.burns[:, :, None]
    wrong = there & ((says & ~burns) | (gone & (seen.code > 0)[:, :, None]))
    inside = (there & says & burns).any(dim=3)
    possible = beliefs.possible * torch.exp(wrong.sum(dim=3) * math.log(doubt))
    new = seen.burns & seen.there & _unforeseen(beliefs, seen)
    reads = needs_no_sync(new.device)
    if not reads or new.any():
        new = new & ~seen.of(grow(_known_fire(beliefs), _APART)[:, :, None])[:, :, 0]
        surprised = new.any(dim=2)
        beliefs = beliefs.replace(fires=beliefs.fires + surprised.to(torch.int32))
        rows = surprised.any(dim=1).nonzero()[:, 0] if reads else torch.arange(len(new), device=new.device)
        where = seen.in_worlds(rows), new[rows], recent[rows]
        taken = _taken_up(state.key[rows], state.step[rows], beliefs[rows], *where)
        old = beliefs.members.held
        taken = {name: old[name].index_copy(0, rows, planes) for name, planes in taken.items()}
        beliefs = beliefs.replace(members=beliefs.members.replace(**taken))
    before = beliefs.lit[:, :, None]
    lit = seen.put(before, seen.of(before) | (seen.burns & seen.is_new)[:, :, None])[:, :, 0]
    return beliefs.replace(possible=possible * ~inside, found=beliefs.found + possible * inside, lit=lit)


def _unforeseen(beliefs: Beliefs, seen: Sightings) -> Tensor:
    """Return which of the cells that are seen burn in few members, bool [B, G, n]."""
    return (is_burning(seen.of(cells_of(beliefs))) * beliefs.weights[..., None]).sum(dim=2) < 0.2


def _known_fire(beliefs: Beliefs) -> Tensor:
    """Return where fire was seen, or burns in a member, bool [B, G, H, W]."""
    return beliefs.lit | is_burning(cells_of(beliefs)).any(dim=2)


def _taken_up(
    key: Tensor, step: Tensor, beliefs: Beliefs, seen: Sightings, new: Tensor, recent: Tensor
) -> dict[str, Tensor]:
    """Return what members hold of a fire that is seen for the first time, where it is not seen.

    Each member takes a hidden fire, moved so that one of its cells that burn as what is seen lies there: another one
    than other members, by how well it fits all that is seen (Gumbel's draws without replacement; Kool et al. 2019).

    Args:
        key: Of the worlds, int64 [B].
        step: int32 [B].
        beliefs: What is believed.
        seen: What is seen.
        new: Which of these cells burn and were not foreseen, bool [B, G, n].
        recent: Cells that were seen lately, bool [B, G, H, W].
    """
    groups, count = beliefs.weights.shape[1:]
    fires = beliefs.hidden.held
    many, (height, width) = fires["cells"].shape[1], fires["cells"].shape[2:]
    key = named_key(key, NAME)
    first = new.to(torch.uint8).argmax(dim=2, keepdim=True)
    place, code = seen.cell.gather(2, first), seen.code.gather(2, first)
    burning = fires["cells"].flatten(2)[:, None]
    draw = uniform(key, step, Stream.IGNITION, (groups, many, height * width))
    fits = draw + 2.0 * (burning == code[..., None]) + is_burning(burning)
    fits = fits + 4.0 * (is_burning(burning) & (torch.arange(height * width, device=draw.device) == place[..., None]))
    start = fits.argmax(dim=3)
    down, right = place // width - start // width, place % width - start % width

    def shifted(planes: Tensor, cell: Tensor, which: Tensor) -> tuple[Tensor, Tensor]:
        """Return what moved fires [B, G, k] of planes [B, M, H, W] hold at cells [B, G, n], and whether anything."""
        south, east = (each.gather(2, which)[..., None] for each in (down, right))
        row, column = cell[:, :, None] // width - south, cell[:, :, None] % width - east
        inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        index = which[..., None] * (height * width) + row.clamp(0, height - 1) * width + column.clamp(0, width - 1)
        return planes.flatten(1).gather(1, index.flatten(1)).view(index.shape), inside

    every = torch.arange(many, device=draw.device).expand(len(key), groups, -1)
    says, inside = shifted(is_burning(fires["cells"]), seen.cell, every)
    gone, _ = shifted(fires["burned"], seen.cell, every)
    burns, tree = seen.burns[:, :, None], is_tree(seen.code)[:, :, None]
    wrong = seen.there[:, :, None] & (((says & inside) != burns) | (gone & inside & tree))
    score = wrong.sum(dim=3) * math.log(DOUBT)
    noise = uniform(key, step, Stream.MEMBERS, (2, groups, many))[:, 1].clamp(min=1e-9)
    best = (score - torch.log(-torch.log(noise))).masked_fill(~is_burning(burning).any(dim=3), -math.inf)
    order = best.argsort(dim=2, descending=True)
    pick = order.gather(2, (torch.arange(count, device=order.device) % many).expand(len(key), groups, -1))
    everywhere = torch.arange(height * width, device=draw.device).expand(len(key), groups, -1)
    members = {name: leaf.unflatten(1, (groups, count)) for name, leaf in beliefs.members.held.items()}
    laws = tuple(name for name in members if name.startswith("extras."))
    burned, on_map = shifted(fires["burned"], everywhere, pick)
    cells, _ = shifted(fires["cells"], everywhere, pick)
    can = best.gather(2, pick)[..., None] > -math.inf
    takes = (is_burning(cells) | burned) & on_map & can & is_tree(members["cells"]).flatten(3)
    takes = takes & new.any(dim=2)[..., None, None] & ~recent.flatten(2)[:, :, None]
    held = {}
    for name in ("cells", "age", "burned", "stage_age", *laws):
        if name in members:
            planes, _ = shifted(fires[name], everywhere, pick)
            held[name] = torch.where(takes, planes, members[name].flatten(3)).view_as(members[name]).flatten(1, 2)
    return held
