"""Ten steps a second on one core, of a match and of what is drawn of it."""

import time

import pytest

from warp_torchrl.env.pictures.veil import first_view, seen_as
from warp_torchrl.live import drawing
from warp_torchrl.live.ground import ground_of
from warp_torchrl.live.match import Match, Setting


def seconds(do, times=5):
    """The least of several times on the processor, which other programs of the machine do not share."""

    def once():
        began = time.process_time()
        do()
        return time.process_time() - began

    do()
    return min(once() for _ in range(times))


def draw(side, ground):
    flies = side.env.world.team.table(side.env.device).flies
    shown = drawing.vehicles(side.state, ground, flies, side.facing)
    drawing.headings(shown, {}, ground)
    drawing.wind_arrows(side.state, ground)
    drawing.glow(side.state, ground)
    state, colours = seen_as(side.state, side.env.world, first_view(side.env.world))
    grown = [make(state, ground, colours[0]) for make in (drawing.tiles, drawing.trees)]
    return grown + [make(state, ground) for make in (drawing.flames, drawing.smoke_puffs)]


def test_a_step_of_a_large_map_is_played_and_drawn_in_a_tenth_of_a_second():
    match = Match(Setting(policy="default", overrides=("scenario=large",)))
    assert match.world.size == (64, 64) and match.world.team.n_agents == 8
    ground = ground_of(match.sides[0].state)

    def step():
        match.step()
        draw(match.sides[0], ground)

    assert seconds(step) < 0.1


@pytest.mark.slow
def test_the_largest_maps_are_drawn_in_a_tenth_of_a_second():
    overrides = ("scenario=giant", "landscape.size=256", "team.n_agents=32")
    match = Match(Setting(policy="noop", overrides=overrides))
    ground = ground_of(match.sides[0].state)
    assert seconds(lambda: draw(match.sides[0], ground)) < 0.1
