"""How well a team of limited sight keeps the fire in sight: measured after every step, in one place."""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.arrays.batch import Batch
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.front import spreading_front
from warp_torchrl.world.state.records import KNOWLEDGE, codes, freshness, steps_since
from warp_torchrl.world.state.state import FIRST_FIRE, WorldState


@dataclass(eq=False, repr=False)
class Memory(Batch):
    """What a team of limited sight keeps of the fire: its records, and what it has watched."""

    records: Tensor  # int32 [B,A,H,W], see ``world.state.records``
    itself: Tensor  # bool [B,A,H,W], whether the agent saw itself what its record tells
    watches: Tensor  # float32 [B,A], share of the front that the team watches by this agent's records, now
    finds: Tensor  # float32 [B,A], burning cells that this agent was the first to record in the last step / all of them
    uncertain: Tensor  # float32 [B], mean over the map of 1 - freshness of the team's newest records, now
    watched: Tensor  # float32 [B], sum over steps of the share of the front that the team watches
    found: Tensor  # float32 [B], sum over steps of the share of the front that the team knows to burn
    uncertainty: Tensor  # float32 [B], sum over steps of ``uncertain``
    fronts: Tensor  # int32 [B], steps at whose end there was a front


@dataclass(frozen=True, eq=False)
class NewestRecords:
    """What the newest record of each cell of any agent of the team tells."""

    burns: Tensor  # bool [B,H,W], that it burns
    burned_before: Tensor  # bool [B,H,W], what ``burns`` was a step ago
    since: Tensor  # int32 [B,H,W], how old it is [steps]; of a cell that nobody saw the step + 1
    fresh: Tensor  # float32 [B,H,W], how fresh it is, 0..1
    holders: Tensor  # bool [B,A,H,W], the agents that hold it and saw it themselves


def memory_of(state: WorldState) -> Memory:
    """Return what teams keep of the fire.

    Raises:
        ValueError: If their sight is not limited.
    """
    return state.planes(KNOWLEDGE, Memory)


def unwatched(state: WorldState, records: Tensor) -> Memory:
    """Return what teams keep before their first look, given their records, int32 [B, A, H, W]."""
    no = torch.zeros_like(state.vehicles.position[..., 0], dtype=torch.bool)
    zero = torch.zeros_like(state.burning_area)
    return Memory(
        records=records,
        itself=no[..., None, None].expand(*no.shape, *state.cells.shape[1:]).clone(),
        watches=no.to(torch.float32),
        finds=no.to(torch.float32),
        uncertain=zero.clone(),
        watched=zero.clone(),
        found=zero.clone(),
        uncertainty=zero.clone(),
        fronts=zero.to(torch.int32),
    )


def at_start(memory: Memory) -> Memory:
    """Return what teams keep before their first step: what they see, in no sum."""
    sums = ("watched", "found", "uncertainty", "fronts")
    return memory.replace(**{name: torch.zeros_like(getattr(memory, name)) for name in sums})


def newest_records(before: Tensor, records: Tensor, itself: Tensor, step: Tensor) -> NewestRecords:
    """Return what the team's newest records tell after a step.

    Args:
        before: The agents' records before it, int32 [B, A, H, W].
        records: The same after it.
        itself: Of ``Memory``, after it.
        step: The worlds' steps after it, int32 [B].
    """
    newest = records.amax(dim=1)
    return NewestRecords(
        burns=codes(newest) >= FIRST_FIRE,
        burned_before=codes(before.amax(dim=1)) >= FIRST_FIRE,
        since=steps_since(newest, step),
        fresh=freshness(newest, step),
        holders=itself & (records == newest[:, None]),
    )


def counted(state: WorldState, before: Memory, records: Tensor, itself: Tensor, recent: int) -> Memory:
    """Return what teams keep after a step.

    The team watches a cell of the front that it saw burn at most ``recent`` steps ago. The agents that hold the newest
    record of a cell, and saw it themselves, share the credit for it.

    Args:
        state: The worlds after the step.
        before: What they kept before it.
        records: Their records after it, int32 [B, A, H, W].
        itself: Of ``Memory``, after it.
        recent: n [steps].
    """
    newest = newest_records(before.records, records, itself, state.step)
    front, burning = spreading_front(state.cells, state.alpha), is_burning(state.cells)
    watched = front & newest.burns & (newest.since <= recent)
    found = burning & newest.burns & ~newest.burned_before & (newest.since == 0)
    share = newest.holders / newest.holders.sum(dim=1, keepdim=True).clamp(min=1)
    size, uncertain = _count(front), (1.0 - newest.fresh).mean(dim=(1, 2))
    return Memory(
        records=records,
        itself=itself,
        watches=(share * watched[:, None]).sum((2, 3)) / size.clamp(min=1)[:, None],
        finds=(share * found[:, None]).sum((2, 3)) / _count(burning).clamp(min=1)[:, None],
        uncertain=uncertain,
        watched=before.watched + _count(watched) / size.clamp(min=1),
        found=before.found + _count(front & newest.burns) / size.clamp(min=1),
        uncertainty=before.uncertainty + uncertain,
        fronts=before.fronts + (size > 0).to(torch.int32),
    )


def _count(cells: Tensor) -> Tensor:
    return cells.sum((1, 2))
