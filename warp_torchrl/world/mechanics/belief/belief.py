"""Beliefs: an ensemble of imagined fires beside the true one, which sightings weigh and correct.

Members tick with the world. What the team sees weighs them (Gordon, Salmond and Smith 1993), and then they are what is
seen, where it is seen (nudging; Mandel et al. 2008 for fires). A fire that was seen once goes on growing in them.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import torch
from torch import Tensor

from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.validation import check_fields
from warp_torchrl.world.arrays.batch import Named
from warp_torchrl.world.arrays.random import Stream, imagined_keys, named_key, normal
from warp_torchrl.world.backends.backend import forecast
from warp_torchrl.world.ensemble.filtering import quantiles
from warp_torchrl.world.ensemble.members import held, in_parameters, rows_of, ticked, unburned, worlds_of
from warp_torchrl.world.mechanics.belief.beliefs import (
    NAME,
    Beliefs,
    beliefs_of,
    disagreement,
    hidden_probability,
    known_probability,
    most_believed,
)
from warp_torchrl.world.mechanics.belief.correcting import corrected, weighed
from warp_torchrl.world.mechanics.belief.hidden import DOUBT, fires_lit, hidden_fires, struck
from warp_torchrl.world.mechanics.belief.sightings import sightings
from warp_torchrl.world.mechanics.mechanic import Mechanic, Metric, Rules
from warp_torchrl.world.mechanics.table import part
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.state.records import KNOWLEDGE, freshness, kept, recorded
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.hearing import HEARING
from warp_torchrl.world.team.knowledge import Belief

_STALE = 1e-3
"""What a cell that was never seen is worth to see, where no fire is thought to be."""
_NEVER = 63
"""The newest record of a cell that nobody saw."""
_PARAMETERS = ("rate", "wind_speed", "bearing")


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
        threshold: Share of the members' weight over which a cell is taken to burn.
        trust: What each cell that is seen counts for in the members' weights; 0 leaves them alike.
        error: Least chance that a member is wrong of a cell.
        rate_deviation: Coefficient of variation of the rate of spread, as far as the team knows; 0: it knows it.
        wind_speed_deviation: The same of the wind's speed.
        bearing_deviation: Standard deviation of the wind's bearing, as far as the team knows [degrees].

    Raises:
        ValueError: If a value is out of its range.
    """

    name: ClassVar[str] = NAME
    turn: ClassVar[int] = 1
    is_knowledge: ClassVar[bool] = True
    maps: ClassVar[Mapping[str, Callable[[WorldState], Tensor]]] = {
        "burn_probability": _believed_map(known_probability),
        "disagreement": _believed_map(disagreement),
    }

    of: Literal["team", "agent"] = "team"
    members: int = 8
    hidden: int = 64
    threshold: float = 0.5
    trust: float = 1.0
    error: float = 0.02
    rate_deviation: float = 0.0
    wind_speed_deviation: float = 0.0
    bearing_deviation: float = 0.0

    def __post_init__(self) -> None:
        check_fields(
            self,
            members=(1, 4096),
            hidden=(0, 4096),
            threshold=(0.0, 1.0),
            trust=(0.0, 1.0),
            error=(1e-6, 0.5),
            rate_deviation=(0.0, 2.0),
            wind_speed_deviation=(0.0, 2.0),
            bearing_deviation=(0.0, 180.0),
        )

    @property
    def weighs(self) -> bool:
        """Return whether sightings weigh members."""
        return self.members > 1 and self.trust > 0.0

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
        possible = torch.ones(*shape, self.hidden, device=state.key.device)
        keys = imagined_keys(key, none, groups * self.members + self.hidden)
        beliefs = Beliefs(
            members=unburned(state, keys[:, self.hidden :], world.fire),
            weights=torch.full((*shape, self.members), 1.0 / self.members, device=state.key.device),
            parameters=self._drawn(key, groups),
            chances=self._no_chances(state, groups),
            hidden=hidden_fires(state, world, keys[:, : self.hidden]) if self.hidden else Named(),
            possible=possible,
            found=torch.zeros_like(possible),
            overlap=none.clone(),
            union=none.clone(),
        )
        state = state.with_planes(NAME, beliefs)
        return self._looked(state, torch.full_like(kept(state), _NEVER), torch.ones_like(state.done), world)

    def step(self, before: WorldState, after: WorldState, running: Tensor, world: Rules) -> WorldState:
        """Return worlds whose beliefs have ticked, and were weighed and corrected by what is seen after the step."""
        after = self._looked(self._ticked(before, after, world), kept(before), running, world)
        beliefs = beliefs_of(after)
        burns, thought = is_burning(after.cells)[:, None], known_probability(beliefs) > self.threshold
        overlap, union = (burns & thought).sum((2, 3)), (burns | thought).sum((2, 3))
        return after.with_planes(
            NAME,
            beliefs.replace(
                overlap=beliefs.overlap + (overlap.sum(1) * running).to(torch.int32),
                union=beliefs.union + (union.sum(1) * running).to(torch.int32),
            ),
        )

    def assumed(self, state: WorldState, world: Rules) -> WorldState:
        """Return the worlds as they are believed to be, see ``beliefs.most_believed``."""
        return most_believed(state, self.threshold)

    def worth_seeing(self, state: WorldState, world: Rules) -> Tensor:
        """Return the chance of each cell to burn, known and hidden, where smoke comes from that nobody explains, and a
        little for each that was long not seen.
        """
        beliefs, records = beliefs_of(state), kept(state)
        records = records.amax(dim=1, keepdim=True) if self.of == "team" else records
        p = known_probability(beliefs)
        burns = p * (1.0 - p) + hidden_probability(beliefs, fires_lit(world.lighting))
        signs = world.sensing.signs(state, world.team, p)
        burns = burns if signs is None else burns + signs
        return burns + _STALE * (1.0 - freshness(records, state.step))

    def futures(self, state: WorldState, world: Rules, count: int) -> WorldState:
        """Return members, as often as they weigh, of worlds with one belief."""
        beliefs = beliefs_of(state)
        total = beliefs.weights[:, 0].cumsum(dim=1)
        at = (torch.arange(count, device=total.device) + 0.5) / count * total[:, -1:]
        pick = torch.searchsorted(total, at).clamp(max=self.members - 1)
        own = {
            name: leaf.gather(1, pick.view(*pick.shape, *[1] * (leaf.ndim - 2)).expand(-1, -1, *leaf.shape[2:]))
            for name, leaf in beliefs.members.held.items()
        }
        worlds, rows = worlds_of(state, Named(own), world.fire), rows_of(state, count)
        for name, planes in state.extras.held.items():
            if name not in (NAME, KNOWLEDGE, HEARING, *world.fire.keeps):
                worlds = worlds.with_planes(name, planes[rows])
        return worlds

    def metric_rows(self, world: Rules) -> tuple[Metric, ...]:
        """Return ``jaccard``, and ``rate_known`` and so on of what the team does not know."""
        known = (Metric(f"{name}_known", "more", "%", "", "Belief") for name, _ in self._unknown)
        return (Metric("jaccard", "more", "%", "", "Belief"), *known)

    def metrics(self, state: WorldState) -> dict[str, Tensor]:
        """Return how well beliefs fit the fire.

        ``jaccard``: cells that burn and are believed to, over those of which either holds, sums over the steps.
        ``rate_known``, ``wind_speed_known``, ``bearing_known``: 1 where the true value lies within the members' 5 to
        95 % quantiles now.
        """
        beliefs = beliefs_of(state)
        found = {"jaccard": beliefs.overlap / beliefs.union.clamp(min=1)}
        for name, index in self._unknown:
            values = beliefs.parameters.held["values"][..., index].flatten(0, 1)
            low, high = quantiles(values, beliefs.weights.flatten(0, 1), values.new_tensor([0.05, 0.95])).unbind(1)
            inside = ((low <= 0.0) & (high >= 0.0)).to(torch.float32).view(len(state.key), -1)
            found[f"{name}_known"] = inside.mean(dim=1)
        return found

    @property
    def _unknown(self) -> list[tuple[str, int]]:
        deviations = (self.rate_deviation, self.wind_speed_deviation, self.bearing_deviation)
        return [(name, index) for index, name in enumerate(_PARAMETERS) if deviations[index]]

    def _drawn(self, key: Tensor, groups: int) -> Named:
        """Return the members' parameters: about an estimate that is off the true value as members are off it."""
        if self.knows_parameters:
            return Named()
        spread = [math.sqrt(math.log1p(each**2)) for each in (self.rate_deviation, self.wind_speed_deviation)]
        scale = torch.tensor([*spread, math.radians(self.bearing_deviation)], device=key.device)
        draws = normal(key, 0, Stream.MEMBERS, (groups, 1 + self.members, len(_PARAMETERS)))
        return Named({"values": (draws[:, :, :1] + draws[:, :, 1:]) * scale})

    def _ticked(self, before: WorldState, after: WorldState, world: Rules) -> WorldState:
        """Return worlds whose members and hidden fires have ticked where the fire has; on a CPU those alone."""
        now = after.tick > before.tick
        if not needs_no_sync(now.device):
            return after.with_planes(NAME, self._after_tick(before, after, now, world))
        index = now.nonzero()[:, 0]
        if not len(index):
            return after
        if len(index) == len(now):
            return after.with_planes(NAME, self._after_tick(before, after, now, world))
        beliefs = beliefs_of(after).clone()
        beliefs[index] = self._after_tick(before[index], after[index], now[index], world)
        return after.with_planes(NAME, beliefs)

    def _after_tick(self, before: WorldState, after: WorldState, now: Tensor, world: Rules) -> Beliefs:
        beliefs = beliefs_of(after)

        values = None if self.knows_parameters else beliefs.parameters.held["values"].flatten(0, 2)
        members = in_parameters(worlds_of(before, beliefs.members, world.fire), world.fire, values)
        count, chances = beliefs.members.held["key"].shape[1], beliefs.chances
        rows = rows_of(before, count)
        if self.weighs:
            ignites = forecast(world.fire, members).ignition_probability * now[rows][:, None, None]
            chances = chances.replace(values=ignites.unflatten(0, (-1, count)))

        def grown(own: Named, worlds: WorldState, count: int, parameters: Tensor | None = None) -> Named:
            rows = rows_of(before, count)
            air = after.air[rows] if world.air.changes else after.air
            new = held(ticked(worlds, world.fire, world.air, now[rows], air, parameters), count, world.fire)
            drawn = (name for name in world.fire.draws if name in own.held)
            return new.replace(**{name: own.held[name] for name in drawn})  # without the factor on their rate

        hidden = beliefs.hidden
        if self.hidden:
            hidden = grown(hidden, worlds_of(before, hidden, world.fire), self.hidden)
        return beliefs.replace(members=grown(beliefs.members, members, count, values), chances=chances, hidden=hidden)

    def _no_chances(self, state: WorldState, groups: int) -> Named:
        if not self.weighs:
            return Named()
        return Named({"values": state.alpha.new_zeros(len(state.key), groups * self.members, *state.alpha.shape[1:])})

    def _looked(self, state: WorldState, before: Tensor, running: Tensor, world: Rules) -> WorldState:
        """Return worlds whose beliefs were weighed and corrected by the records that are newer than before."""
        records = kept(state)
        if self.of == "team":
            records, before = records.amax(dim=1, keepdim=True), before.amax(dim=1, keepdim=True)
        ticked_at = state.step - state.step % world.steps_per_tick
        seen = sightings(before, records, running, recorded(torch.zeros_like(ticked_at), ticked_at))
        beliefs, (miss, false_alarm) = beliefs_of(state), world.sensing.errors
        if self.weighs:
            beliefs = weighed(state, beliefs, seen, self.trust, self.error, (miss, false_alarm))
        if self.hidden:
            beliefs = struck(state, beliefs, seen, max(miss, DOUBT))
        made = corrected(state, beliefs, seen, world.fire, miss, false_alarm)
        return state.with_planes(NAME, made)
