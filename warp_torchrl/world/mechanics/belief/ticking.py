"""Ticks of beliefs: imagined fires grow where the true one does, and agents' acts reach them."""

import torch
from torch import Tensor

from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.world.arrays.batch import Named
from warp_torchrl.world.backends.backend import forecast
from warp_torchrl.world.ensemble.members import as_known, held, in_parameters, rows_of, ticked, worlds_of
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.mechanics.belief.beliefs import NAME, Beliefs, beliefs_of, cells_of, mean_of
from warp_torchrl.world.mechanics.belief.learning import learned, watched
from warp_torchrl.world.mechanics.belief.sightings import newest, since_tick
from warp_torchrl.world.mechanics.mechanic import Rules
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.records import kept, recorded
from warp_torchrl.world.state.state import EMPTY, FIRST_FIRE, WorldState


def after_tick(before: WorldState, after: WorldState, world: Rules, law: Automaton) -> WorldState:
    """Return worlds whose members and hidden fires have ticked where the fire has; on a CPU those alone.

    Args:
        before: The worlds before the step.
        after: After it, with beliefs that have not ticked.
        world: Its rules.
        law: By which fires are imagined.
    """
    now = after.tick > before.tick
    if not needs_no_sync(now.device):
        return after.with_planes(NAME, _ticked(before, after, now, world, law))
    index = now.nonzero()[:, 0]
    if not len(index):
        return after
    if len(index) == len(now):
        return after.with_planes(NAME, _ticked(before, after, now, world, law))
    beliefs = beliefs_of(after).clone()
    beliefs[index] = _ticked(before[index], after[index], now[index], world, law)
    return after.with_planes(NAME, beliefs)


def _ticked(before: WorldState, after: WorldState, now: Tensor, world: Rules, law: Automaton) -> Beliefs:
    beliefs = _learned(before, _acted(before, after), now, world, law)
    known, members = beliefs.learning, worlds_of(before, beliefs.members, world.fire)
    values = as_known(members, world.fire, law) if known is None else known.members.flatten(0, 2)
    members = in_parameters(members, law, values)
    count, chances = beliefs.members.held["key"].shape[1], beliefs.chances
    if chances.held:  # kept where what is seen weighs the members
        ignites = forecast(law, members).ignition_probability * now[rows_of(before, count)][:, None, None]
        chances = chances.replace(values=ignites.unflatten(0, (-1, count)))

    def grown(own: Named, worlds: WorldState, count: int, parameters: Tensor | None) -> Named:
        rows = rows_of(before, count)
        air = after.air[rows] if world.air.changes else after.air
        new = held(ticked(worlds, law, world.air, now[rows], air, parameters), count, law)
        drawn = (name for name in world.fire.draws if name in own.held)
        return new.replace(**{name: own.held[name] for name in drawn})  # without the factor on their rate

    hidden = beliefs.hidden
    if hidden.held:
        worlds = worlds_of(before, hidden, law)
        lit = as_known(worlds, world.fire, law) if known is None else known.hidden.flatten(0, 1)
        worlds = in_parameters(worlds, law, lit)
        hidden = grown(hidden, worlds, hidden.held["key"].shape[1], lit)
    return beliefs.replace(members=grown(beliefs.members, members, count, values), chances=chances, hidden=hidden)


def _acted(before: WorldState, after: WorldState) -> Beliefs:
    """Return beliefs without the fire and trees that agents have just put out and cleared, and see so now."""
    beliefs, now = beliefs_of(after), recorded(torch.zeros_like(after.step), after.step)
    put_out, cleared = is_burning(before.cells) & is_tree(after.cells), after.firebreak & ~before.firebreak
    seen = newest(kept(after), beliefs.weights.shape[1]) >= now[:, None, None, None]
    acted = (put_out | cleared)[:, None] & seen
    cells = torch.where(acted[:, :, None], EMPTY, cells_of(beliefs)).to(torch.uint8).flatten(1, 2)
    return beliefs.replace(members=beliefs.members.replace(cells=cells))


def _learned(before: WorldState, beliefs: Beliefs, now: Tensor, world: Rules, law: Automaton) -> Beliefs:
    """Return beliefs that have learned of the last tick, and keep what they know of the fire's edge before this."""
    known = beliefs.learning
    if known is None:
        return beliefs
    known = learned(before, known, law, world.sensing.errors, now)
    cells, wet = (beliefs.members.held[name].unflatten(1, beliefs.weights.shape[1:]) for name in ("cells", "wet"))
    spreads = (cells >= FIRST_FIRE) & (cells <= world.fire.last_spreading)
    fuel = (is_tree(cells) & (cells >= world.fire.youngest_fuel) & (wet == 0)).any(dim=2)
    planes = mean_of(beliefs, spreads), mean_of(beliefs, is_burning(cells)), fuel & (before.alpha > 0.0)[:, None]
    records, since = newest(kept(before), beliefs.weights.shape[1]), since_tick(before, world)
    return beliefs.replace(learning=watched(before, known, planes, records, since))
