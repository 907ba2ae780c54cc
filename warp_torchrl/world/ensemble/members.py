"""Members: imagined worlds that share ground, clock and team with true ones, and burn on their own.

What differs from member to member is held by name, each tensor [B, M, ...]; the rest is read from the true worlds. Only
what everybody knows may be read there: the ground, the clock, the wind, the team.
"""

from collections.abc import Iterable, Mapping

import torch
from torch import Tensor

from warp_torchrl.world.air.wind import Wind, turned
from warp_torchrl.world.arrays.batch import Named
from warp_torchrl.world.backends import backend
from warp_torchrl.world.backends.tick import advance
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.state.state import FIRST_FIRE, Air, WorldState

_OWN = ("cells", "age", "stage_age", "extinguished", "burned", "firebreak", "wet", "key")
"""What differs from member to member, of the tensors of a state by name, beside what the law keeps and draws."""


def imagined(state: WorldState, without: Iterable[str], key: Tensor | None = None) -> WorldState:
    """Return worlds whose future is another: what was drawn at the start of the episode stays.

    So stay the ground, the prevailing wind and the hour of the weather.

    Args:
        state: The worlds.
        without: Mechanics whose planes are left out.
        key: Of the draws from now on, int64 [B]; None keeps it.
    """
    return state.without_planes(*without).replace(key=state.key if key is None else key, origin=state.episode_key)


def rows_of(state: WorldState, count: int) -> Tensor:
    """Return the true world of each member, int64 [B * count]."""
    return torch.arange(len(state.key), device=state.key.device).repeat_interleave(count)


def bare(state: WorldState, fire: Automaton) -> WorldState:
    """Return worlds without what mechanics keep, whose draws at the start of the episode stay the true ones'."""
    return imagined(state, [name for name in state.extras.held if name not in fire.keeps])


def unburned(state: WorldState, keys: Tensor, fire: Automaton) -> Named:
    """Return members in which nothing has burned yet.

    Args:
        state: The true worlds.
        keys: Of the members' draws, int64 [B, M].
        fire: The automaton.
    """
    worlds = bare(state, fire)[rows_of(state, keys.shape[1])]
    no, none = torch.zeros_like(worlds.burned), torch.zeros_like(worlds.cells)
    worlds = worlds.replace(
        ground=fire.drawn_again(worlds.ground, keys.flatten()),
        cells=worlds.landscape.age.clone(),
        age=none,
        stage_age=None if worlds.stage_age is None else none.clone(),
        extinguished=no,
        burned=no.clone(),
        firebreak=no.clone(),
        wet=none.clone(),
        key=keys.flatten(),
    )
    return held(fire.started(worlds), keys.shape[1], fire)


def held(worlds: WorldState, count: int, fire: Automaton) -> Named:
    """Return what differs from member to member of worlds, batch size [B * count]."""
    leaves = worlds.leaves()
    laws = tuple(name for name in leaves if name.startswith(tuple(f"extras.{each}." for each in fire.keeps)))
    names = (*(name for name in _OWN if name in leaves), *laws, *(name for name in fire.draws if name in leaves))
    return Named({name: leaves[name].unflatten(0, (-1, count)) for name in names})


def worlds_of(state: WorldState, members: Named, fire: Automaton) -> WorldState:
    """Return members of worlds as worlds, batch size [B * M]."""
    own: Mapping[str, Tensor] = {name: each.flatten(0, 1) for name, each in members.held.items()}
    base, rows = bare(state, fire), rows_of(state, members.held["key"].shape[1])
    leaves = base.leaves().items()
    return base.with_leaves({name: own[name] if name in own else leaf.index_select(0, rows) for name, leaf in leaves})


def lit(worlds: WorldState, where: Tensor, fire: Automaton) -> WorldState:
    """Return worlds in which trees, bool [n, H, W], were set alight now."""
    cells = torch.where(where, FIRST_FIRE, worlds.cells)
    age = torch.where(where, worlds.cells, worlds.age)
    return fire.lit(worlds.replace(cells=cells.to(torch.uint8), age=age), where)


def ticked(
    worlds: WorldState, fire: Automaton, wind: Wind, now: Tensor, air: Air, parameters: Tensor | None = None
) -> WorldState:
    """Return imagined worlds after a tick of the fire with draws of their own, and in the wind after it.

    Args:
        worlds: Imagined ones before the tick, ``in_parameters``, batch size [n].
        fire: The automaton.
        wind: The air.
        now: Which tick now, bool [n].
        air: Of the true world of each after the tick, batch size [n]; it is read where the wind changes.
        parameters: Of ``in_parameters``; None leaves wind and rate as they are known.
    """
    if wind.changes:
        air = air.replace(wind=in_other_air(air.wind, parameters))
    return advance(worlds, fire, wind, now, air)


def in_parameters(worlds: WorldState, fire: Automaton, parameters: Tensor | None) -> WorldState:
    """Return worlds in another wind, at another rate of spread.

    Args:
        worlds: In the wind and at the rate that are known, batch size [n].
        fire: The automaton.
        parameters: float32 [n, 3]: logarithms of the factors on the rate of spread and on the wind's speed, and the
            angle by which the wind is turned to the left [rad]. None changes nothing.
    """
    if parameters is None:
        return worlds
    ground = fire.at_rate(worlds.ground, parameters[:, 0].exp())
    wind = in_other_air(worlds.wind, parameters)
    return worlds.replace(ground=ground, air=backend.air(fire, wind, worlds.air.moisture, ground))


def as_known(worlds: WorldState, fire: Automaton, imagined: Automaton) -> Tensor | None:
    """Return the parameters, see ``in_parameters``, of worlds in the wind and at the rate that are known.

    None where fires are imagined by the law of the true ones: then nothing of it need be made anew.
    """
    return None if imagined is fire else torch.zeros(len(worlds.key), 3, device=worlds.key.device)


def in_other_air(wind: Tensor, parameters: Tensor | None) -> Tensor:
    """Return a wind [n, 2, h, w] of another speed and bearing, see ``in_parameters``."""
    if parameters is None:
        return wind
    return turned(wind, parameters[:, 2]) * parameters[:, 1].exp()[:, None, None, None]
