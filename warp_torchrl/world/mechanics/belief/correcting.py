"""Weights and corrections of a belief's members by sightings.

A member's likelihood counts the cells that it tells and those that it does not; members of little weight are replaced
by copies of heavy ones (Gordon, Salmond and Smith 1993). Then each member's cells that were seen become what was seen,
by Bayes' rule where sight errs.
"""

import torch
from torch import Tensor

from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.world.arrays.batch import Named
from warp_torchrl.world.arrays.random import Stream, named_key, uniform, uniform_at
from warp_torchrl.world.ensemble.filtering import effective, normalised, resampled
from warp_torchrl.world.ensemble.members import rows_of, worlds_of
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.mechanics.belief.beliefs import NAME, Beliefs, cells_of
from warp_torchrl.world.mechanics.belief.sightings import Sightings
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.state import FIRST_FIRE, WorldState

UNSURE = 0.01
"""Least chance that any cell is taken to burn with, and its error is weighed by."""
SURE = 0.8
"""Largest chance that a cell is taken to burn with, though all members say so: fires are put out and die."""


def weighed(
    state: WorldState, beliefs: Beliefs, seen: Sightings, trust: float, doubt: float, errors: tuple[float, float]
) -> Beliefs:
    """Return beliefs whose members are weighed by what is seen, and drawn again where few of them count.

        log L = trust sum_seen log(b p' + (1 - b) (1 - p')),   p' = p (1 - miss) + (1 - p) false_alarm

    b is 1 where a cell is seen to burn, else 0, and p the member's chance that it does: of a tree the probability to
    ignite in the last tick, of other cells 0 or 1; no less than ``doubt``, and no more than 1 - ``doubt``. Draws of the
    members do not matter where they knew a cell before the tick. Cells count that are seen for the first time since.

    Args:
        state: The worlds.
        beliefs: What was believed.
        seen: What is seen.
        trust: What each cell counts for, in 0..1.
        doubt: Least chance that a member is wrong of a cell.
        errors: ``miss`` and ``false_alarm``.
    """
    planes = beliefs.chances.held["values"].unflatten(1, beliefs.weights.shape[1:])
    ignites, says = seen.of(planes), is_burning(seen.of(cells_of(beliefs))).to(torch.float32)
    miss, false_alarm = errors
    p = torch.where(ignites > 0.0, ignites, says).clamp(doubt, 1.0 - doubt)
    p = p * (1.0 - miss) + (1.0 - p) * false_alarm
    counts = (seen.first & (seen.burns | is_tree(seen.code)))[:, :, None]
    log = torch.where(counts, torch.where(seen.burns[:, :, None], p, 1.0 - p).log(), 0.0)
    log = beliefs.weights.clamp(min=1e-12).log() + trust * log.to(torch.float64).sum(dim=3).to(torch.float32)
    weights = normalised(log.flatten(0, 1))
    poor = (effective(weights) < 0.5 * weights.shape[1]).view(log.shape[:2])
    weights = weights.view(log.shape)
    beliefs = beliefs.replace(weights=weights)
    if needs_no_sync(poor.device) and not poor.any():
        return beliefs
    return _drawn_again(state, beliefs, poor)


def _drawn_again(state: WorldState, beliefs: Beliefs, poor: Tensor) -> Beliefs:
    """Return beliefs whose members are drawn again by their weights, where they are poor, bool [B, G]."""
    groups, count = beliefs.weights.shape[1:]
    key, weights = named_key(state.key, NAME), beliefs.weights.flatten(0, 1)
    index = resampled(weights, uniform(key, state.step, Stream.MEMBERS, (groups,)).flatten()).view(-1, groups, count)
    index = torch.where(poor[..., None], index, torch.arange(count, device=index.device))
    flat = (index + count * torch.arange(groups, device=index.device)[:, None]).flatten(1)

    def drawn(leaf: Tensor) -> Tensor:
        return leaf.gather(1, flat.view(*flat.shape, *[1] * (leaf.ndim - 2)).expand_as(leaf))

    own = {name: leaf if name == "key" else drawn(leaf) for name, leaf in beliefs.members.held.items()}
    chances = {name: drawn(leaf) for name, leaf in beliefs.chances.held.items()}
    return beliefs.replace(
        members=Named(own),
        chances=Named(chances),
        weights=torch.where(poor[..., None], 1.0 / count, beliefs.weights),
    )


def corrected(
    state: WorldState, beliefs: Beliefs, seen: Sightings, fire: Automaton, miss: float, false_alarm: float
) -> Beliefs:
    """Return beliefs whose members are what is seen, where it is seen.

    Where sight errs a cell burns in a member with the chance that Bayes' rule gives, with p the share of the members
    that say so, between ``UNSURE`` and ``SURE``: p (1 - miss) / (p (1 - miss) + (1 - p) false_alarm) if it is seen to
    burn, p miss / (p miss + (1 - p) (1 - false_alarm)) if not. What is wet was put out, and does not burn.

    Args:
        state: The worlds; ``wet`` is read of cells that are seen.
        beliefs: What is believed.
        seen: What is seen.
        fire: The automaton.
        miss: Chance that a fire is taken for a tree.
        false_alarm: Chance that a tree is taken for a fire.
    """
    planes = {name: each.unflatten(1, beliefs.weights.shape[1:]) for name, each in beliefs.members.held.items()}
    cells, age, burned, firebreak, wet = (seen.of(planes[n]) for n in ("cells", "age", "burned", "firebreak", "wet"))
    damp, burned_before = seen.of(state.wet[:, None, None]), is_burning(cells)
    tree = torch.where(is_tree(cells), cells, seen.of(state.landscape.age[:, None, None]))
    code = seen.code[:, :, None].expand_as(cells)
    if miss or false_alarm:
        burns = _draws(state, beliefs, seen) < _chance(beliefs, seen, damp[:, :, 0] > 0, miss, false_alarm)[:, :, None]
        lights = torch.where(seen.burns[:, :, None], code, torch.where(burned_before, cells, FIRST_FIRE))
        code = torch.where(burns, lights, torch.where(seen.burns[:, :, None], tree, code))
    new = seen.is_new[:, :, None]
    after = torch.where(new, code, cells)
    is_lit = is_burning(after) & ~burned_before
    changed = {
        "cells": after,
        "age": torch.where(is_burning(after), torch.where(burned_before, age, tree), 0),
        "burned": torch.where(new, seen.ash[:, :, None], burned),
        "firebreak": torch.where(new, seen.cleared[:, :, None], firebreak),
        "wet": torch.where(new, damp, wet),
    }
    put = {name: seen.put(planes[name], values).flatten(1, 2) for name, values in changed.items()}
    members = beliefs.members.replace(**put)
    if fire.keeps:
        members = _lit(state, members, seen.put(torch.zeros_like(planes["burned"]), is_lit).flatten(0, 2), fire)
    return beliefs.replace(members=members)


def _lit(state: WorldState, members: Named, where: Tensor, fire: Automaton) -> Named:
    """Return members in which the law knows of cells, bool [B * G * K, H, W], that they were set alight now."""
    leaves = fire.lit(worlds_of(state, members, fire), where).leaves()
    laws = [name for name in members.held if name.startswith("extras.")]
    return members.replace(**{name: leaves[name].view_as(members.held[name]) for name in laws})


def _chance(beliefs: Beliefs, seen: Sightings, damp: Tensor, miss: float, false_alarm: float) -> Tensor:
    """Return the chance of each cell that is seen to burn, float32 [B, G, n]; see ``corrected``."""
    share = (is_burning(seen.of(cells_of(beliefs))) * beliefs.weights[..., None]).sum(dim=2).clamp(UNSURE, SURE)
    fire = share * (1.0 - miss) / (share * (1.0 - miss) + (1.0 - share) * false_alarm)
    tree = share * miss / (share * miss + (1.0 - share) * (1.0 - false_alarm))
    chance = torch.where(seen.burns, fire, torch.where(is_tree(seen.code), tree, 0.0))
    return torch.where(damp, 0.0, chance)


def _draws(state: WorldState, beliefs: Beliefs, seen: Sightings) -> Tensor:
    """Return a draw for each member and each cell that is seen, float32 [B, G, K, n]."""
    groups, count = beliefs.weights.shape[1:]
    keys = beliefs.members.held["key"].flatten()
    at = seen.cell[:, :, None].expand(-1, -1, count, -1).flatten(0, 2).to(torch.int32)
    step = state.step[rows_of(state, groups * count)]
    return uniform_at(keys, step, Stream.SENSING, at).unflatten(0, (-1, groups, count))
