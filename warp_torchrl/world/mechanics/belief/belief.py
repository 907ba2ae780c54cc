"""Beliefs: an ensemble of imagined fires beside the true one, which sightings weigh and correct.

Members tick with the world. What the team sees weighs them (Gordon, Salmond and Smith 1993), and then they are what is
seen, where it is seen (nudging; Mandel et al. 2008 for fires). A fire that was seen once goes on growing in them.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import torch
from torch import Tensor

from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.batch import Named
from warp_torchrl.world.arrays.random import imagined_keys, named_key
from warp_torchrl.world.ensemble.filtering import moments, resampled
from warp_torchrl.world.ensemble.members import as_known, in_parameters, rows_of, unburned, worlds_of
from warp_torchrl.world.law.automaton import Automaton
from warp_torchrl.world.mechanics.belief.beliefs import (
    NAME,
    Beliefs,
    beliefs_of,
    burn_soon,
    disagreement,
    hidden_fire,
    hidden_probability,
    known_probability,
    most_believed,
)
from warp_torchrl.world.mechanics.belief.correcting import corrected, weighed
from warp_torchrl.world.mechanics.belief.fit import counted, metrics_of
from warp_torchrl.world.mechanics.belief.hidden import DOUBT, fires_lit, hidden_fires, struck
from warp_torchrl.world.mechanics.belief.learning import PARAMETERS, Learning, begun, noted
from warp_torchrl.world.mechanics.belief.sightings import newest, sightings, since_tick
from warp_torchrl.world.mechanics.belief.soon import foreseen
from warp_torchrl.world.mechanics.belief.ticking import after_tick
from warp_torchrl.world.mechanics.mechanic import Mechanic, Metric, Rules
from warp_torchrl.world.mechanics.table import part
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.records import KNOWLEDGE, freshness, kept
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.hearing import HEARING
from warp_torchrl.world.team.knowledge import Belief

_STALE = 1e-3
"""What a cell that was never seen is worth to see, where no fire is thought to be."""
_NEVER = 63
"""The newest record of a cell that nobody saw."""


def _believed_map(show: Callable[[Beliefs], Tensor]) -> Callable[[WorldState], Tensor]:
    """Return a map of a belief, whole numbers 0..255, uint8 [B, H, W], or [B, A, H, W] of each agent's own."""

    def shown(state: WorldState) -> Tensor:
        codes = (show(beliefs_of(state)).clamp(0.0, 1.0) * 255.0).to(torch.uint8)
        return codes[:, 0] if codes.shape[1] == 1 else codes

    return shown


@part
@dataclass(frozen=True, kw_only=True)
class Ensemble(Belief, Mechanic):
    """What agents of limited sight believe of the fire: K imagined fires, and M fires that may be hidden.

    Attributes:
        of: Whose: ``team`` keeps one belief, for which agents share their maps everywhere at once; ``agent`` keeps one
            for each.
        members: K. One is enough to know where a fire that was seen is by now; more weigh unknown winds and rates.
        hidden: M, fires that may be anywhere; 0 does without.
        particles: Rates and winds without maps from which the team learns what it does not know of them.
        threshold: Share of the members' weight over which a cell is taken to burn.
        trust: What each cell that is seen counts for in the members' weights; 0 leaves them alike and maps apart.
            None is 1 where sight errs, else 0.
        error: Least chance that a member is wrong of a cell.
        rate_deviation: Coefficient of variation of the rate of spread, as far as the team knows; 0: it knows it.
        wind_speed_deviation: The same of the wind's speed.
        bearing_deviation: Standard deviation of the wind's bearing, as far as the team knows [degrees].
        kernel: The wind's factor by which fires are imagined, ``fire.kernel``; None: that of the true ones. A stress
            test: another one than theirs is a team that is wrong of the law.
        soon: Ticks of the fire within which ``burn_soon`` shows what may burn.

    Raises:
        ValueError: If a value is out of its range.
    """

    name: ClassVar[str] = NAME
    turn: ClassVar[int] = 1
    is_knowledge: ClassVar[bool] = True
    maps: ClassVar[Mapping[str, Callable[[WorldState], Tensor]]] = {
        "burn_probability": _believed_map(known_probability),
        "burn_soon": _believed_map(burn_soon),
        "disagreement": _believed_map(disagreement),
        "hidden_fire": _believed_map(hidden_fire),
    }

    of: Literal["team", "agent"] = "team"
    members: int = 8
    hidden: int = 64
    particles: int = 512
    threshold: float = 0.5
    trust: float | None = None
    error: float = 0.02
    rate_deviation: float = 0.0
    wind_speed_deviation: float = 0.0
    bearing_deviation: float = 0.0
    kernel: Literal["alexandridis", "ellipse", "fbp"] | None = None
    soon: int = 2

    def __post_init__(self) -> None:
        check_fields(
            self,
            members=(1, 4096),
            hidden=(0, 4096),
            particles=(16, 65_536),
            threshold=(0.0, 1.0),
            trust=(0.0, 1.0),
            error=(1e-6, 0.5),
            rate_deviation=(0.0, 2.0),
            wind_speed_deviation=(0.0, 2.0),
            bearing_deviation=(0.0, 180.0),
            soon=(1, 64),
        )

    def law(self, fire: Automaton) -> Automaton:
        """Return the law by which fires are imagined."""
        return fire if self.kernel is None else replace(fire, kernel=self.kernel)  # type: ignore[call-arg]

    def trusts(self, world: Rules) -> float:
        """Return what each cell that is seen counts for in the members' weights; 0 where they stay alike."""
        if self.members == 1:
            return 0.0
        return float(any(world.sensing.errors)) if self.trust is None else self.trust

    @property
    def knows_parameters(self) -> bool:
        """Return whether the team knows wind and rate of spread."""
        return not (self.rate_deviation or self.wind_speed_deviation or self.bearing_deviation)

    def check(self, world: Rules) -> None:
        """Check that the team's sight is limited, and that it shares its maps where it has one belief.

        Raises:
            ValueError: If not.
        """
        if not world.sensing.is_limited:
            raise ValueError("belief must be none where agents see all (sensing=full)")
        if self.kernel is not None and not hasattr(world.fire, "kernel"):
            raise ValueError(f"belief.kernel must be null under a law without one, got {self.kernel}")
        if self.of == "team" and not (world.hearing.sends_maps and world.hearing.is_everywhere):
            raise ValueError(
                "belief.of must be agent where the team does not share its maps everywhere at once "
                "(mechanics.radio.carries=map without range, loss, delay and line_of_sight), got team"
            )

    def begin(self, state: WorldState, world: Rules) -> WorldState:
        """Return worlds with beliefs in which nothing burns but what agents see, and where fires may be hidden."""
        groups = 1 if self.of == "team" else world.team.n_agents
        key, none = named_key(state.key, NAME), torch.zeros_like(state.step)
        shape = (len(state.key), groups)
        none_burns = state.alpha.new_zeros(*shape, *state.alpha.shape[1:])
        possible = torch.ones(*shape, self.hidden, device=state.key.device)
        keys = imagined_keys(key, none, groups * self.members + self.hidden)
        beliefs = Beliefs(
            members=unburned(state, keys[:, self.hidden :], world.fire),
            weights=torch.full((*shape, self.members), 1.0 / self.members, device=state.key.device),
            learning=self._begun(state, key, groups),
            chances=self._no_chances(state, groups, world),
            hidden=hidden_fires(state, world, keys[:, : self.hidden]) if self.hidden else Named(),
            possible=possible,
            found=torch.zeros_like(possible),
            lit=torch.zeros_like(state.burned)[:, None].expand(-1, groups, -1, -1).clone(),
            fires=torch.zeros(shape, dtype=torch.int32, device=state.key.device),
            unseen=none_burns,
            soon=none_burns.clone(),
            overlap=none.clone(),
            union=none.clone(),
            skill=torch.zeros_like(state.burning_area),
            skills=torch.zeros_like(state.burning_area),
            alight=none.clone(),
        )
        state = state.with_planes(NAME, beliefs)
        always = torch.ones_like(state.done)
        state = self._looked(state, torch.full_like(kept(state), _NEVER), always, world)
        return foreseen(state, always, world, self.law(world.fire), self.soon)

    def step(self, before: WorldState, after: WorldState, running: Tensor, world: Rules) -> WorldState:
        """Return worlds whose beliefs have ticked, and were weighed and corrected by what is seen after the step."""
        now = after.tick > before.tick
        after = after_tick(before, after, world, self.law(world.fire))
        after = self._looked(after, kept(before), running, world)
        after = foreseen(after, now, world, self.law(world.fire), self.soon)
        beliefs = beliefs_of(after)
        return after.with_planes(NAME, counted(beliefs, is_burning(after.cells), running, self.threshold))

    def assumed(self, state: WorldState, world: Rules) -> WorldState:
        """Return the worlds as they are believed to be, see ``beliefs.most_believed``, in the mean wind and rate."""
        believed, known = most_believed(state, self.threshold), beliefs_of(state).learning
        fire = self.law(world.fire)
        if known is None:
            return in_parameters(believed, fire, as_known(believed, world.fire, fire))
        mean, _ = moments(known.particles.flatten(0, 1), known.weights.flatten(0, 1))
        return in_parameters(believed, fire, mean)

    def worth_seeing(self, state: WorldState, world: Rules) -> Tensor:
        """Return the chance of each cell to burn, known and hidden, where smoke comes from that nobody explains, and a
        little for each that was long not seen.
        """
        beliefs = beliefs_of(state)
        records = newest(kept(state), beliefs.weights.shape[1])
        p = known_probability(beliefs)
        burns = p * (1.0 - p) + beliefs.unseen
        signs = world.sensing.signs(state, world.team, p)
        burns = burns if signs is None else burns + signs
        return burns + _STALE * (1.0 - freshness(records, state.step))

    def hidden_chance(self, state: WorldState, world: Rules) -> Tensor:
        """Return the chance of each cell to burn by a fire that nobody saw, float32 [B, G, H, W].

        It is 0 of cells that cannot burn, or were seen since the last tick.
        """
        beliefs, since = beliefs_of(state), since_tick(state, world)[:, None, None, None]
        may = (state.alpha > 0.0)[:, None] & (newest(kept(state), beliefs.weights.shape[1]) < since)
        return hidden_probability(beliefs, fires_lit(world.lighting)) * may

    def believed_fire(self, state: WorldState, world: Rules) -> tuple[Tensor, Tensor]:
        """Return the members' share that burns, and the chance of a hidden fire, float32 [B, G, H, W] each."""
        beliefs = beliefs_of(state)
        return known_probability(beliefs), beliefs.unseen

    def futures(self, state: WorldState, world: Rules, count: int) -> WorldState:
        """Return members, as often as they weigh, of worlds with one belief."""
        beliefs = beliefs_of(state)
        half = torch.full_like(beliefs.weights[:, 0, 0], 0.5)
        pick = resampled(beliefs.weights[:, 0], half, count)

        def picked(leaf: Tensor) -> Tensor:
            return leaf.gather(1, pick.view(*pick.shape, *[1] * (leaf.ndim - 2)).expand(-1, -1, *leaf.shape[2:]))

        own = Named({name: picked(leaf) for name, leaf in beliefs.members.held.items()})
        fire, worlds, rows = self.law(world.fire), worlds_of(state, own, world.fire), rows_of(state, count)
        known = beliefs.learning
        values = as_known(worlds, world.fire, fire) if known is None else picked(known.members[:, 0]).flatten(0, 1)
        worlds = in_parameters(worlds, fire, values)
        hidden = [each for each in world.loop if each.is_hidden]
        others = (NAME, KNOWLEDGE, HEARING, *world.fire.keeps, *(each.name for each in hidden))
        for name, planes in state.extras.held.items():
            if name not in others:
                worlds = worlds.with_planes(name, planes[rows])
        for each in hidden:
            worlds = each.begin(worlds, world)
        return worlds

    def metric_rows(self, world: Rules) -> tuple[Metric, ...]:
        """Return ``jaccard`` and ``skill``, and ``rate_known`` and so on of what the team does not know."""
        known = (Metric(f"{name}_known", "more", "%", "", "Belief") for name, _ in self._unknown)
        doubt = (Metric(f"{name}_doubt", "less", "1", "", "Doubt") for name, _ in self._unknown)
        return (*(Metric(name, "more", "%", "", "Belief") for name in ("jaccard", "skill")), *known, *doubt)

    def metrics(self, state: WorldState) -> dict[str, Tensor]:
        """Return how well beliefs fit the fire, see ``fit.metrics_of``."""
        return metrics_of(beliefs_of(state), self._unknown)

    @property
    def _unknown(self) -> list[tuple[str, int]]:
        deviations = (self.rate_deviation, self.wind_speed_deviation, self.bearing_deviation)
        return [(name, index) for index, name in enumerate(PARAMETERS) if deviations[index]]

    def _begun(self, state: WorldState, key: Tensor, groups: int) -> Learning | None:
        if self.knows_parameters:
            return None
        deviations = self.rate_deviation, self.wind_speed_deviation, self.bearing_deviation
        return begun(state, key, deviations, (groups, self.members, self.hidden, self.particles))

    def _no_chances(self, state: WorldState, groups: int, world: Rules) -> Named:
        if not self.trusts(world):
            return Named()
        return Named({"values": state.alpha.new_zeros(len(state.key), groups * self.members, *state.alpha.shape[1:])})

    def _looked(self, state: WorldState, before: Tensor, running: Tensor, world: Rules) -> WorldState:
        """Return worlds whose beliefs were weighed and corrected by the records that are newer than before."""
        beliefs, (miss, false_alarm) = beliefs_of(state), world.sensing.errors
        before, records = (newest(each, beliefs.weights.shape[1]) for each in (before, kept(state)))
        since = since_tick(state, world)
        seen = sightings(before, records, running, since)
        if self.trusts(world):
            beliefs = weighed(state, beliefs, seen, self.trusts(world), self.error, (miss, false_alarm))
        if beliefs.learning is not None:
            beliefs = beliefs.replace(learning=noted(beliefs.learning, seen.cell, seen.first, seen.burns))
        if self.hidden:
            beliefs = struck(state, beliefs, seen, max(miss, DOUBT), before >= since[:, None, None, None])
        made = corrected(state, beliefs, seen, world.fire, miss, false_alarm)
        state = state.with_planes(NAME, made)
        return state.with_planes(NAME, made.replace(unseen=self.hidden_chance(state, world)))
