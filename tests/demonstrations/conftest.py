"""A match in which people took part, and its recording."""

from copy import deepcopy
from dataclasses import replace

import pytest

from warp_torchrl.live.match import Match, Setting
from warp_torchrl.live.order import Order
from warp_torchrl.world.state.cells import is_tree

SMALL = ("landscape.size=16", "team.n_agents=3", "horizon=30")


def played_match():
    """Twelve steps: a person drives agent 0 and waits at times, agent 1 has an order, the world is interfered with."""
    made = Match(Setting(policy="coordinated", overrides=SMALL))
    side, names = made.sides[0], made.sides[0].env.action_names
    side.crew.take(0, person=1)
    side.order(1, Order(row=3, column=3, radius=2))
    for step in range(12):
        if step == 2:
            row, column = is_tree(made.alone.state.cells[0]).nonzero()[-1].tolist()
            made.clear(row, column)
        if step == 3:
            made.blow(9.0, 90.0)
        if step == 4:
            trees = is_tree(made.alone.state.cells[0]) & (made.alone.state.cells[0] > 3)
            row, column = trees.nonzero()[len(trees.nonzero()) // 2].tolist()
            made.ignite(row, column)
        if step % 3:
            side.crew.press(0, 1, names.index("south" if step < 6 else "west"))
        made.step()
    return made


@pytest.fixture
def match():
    return played_match()


@pytest.fixture(scope="session")
def kept_recording():
    return played_match().sides[0].record()


@pytest.fixture
def recording(kept_recording):
    """The recording of such a match, which a test may change."""
    return replace(kept_recording, steps=kept_recording.steps.clone(), environment=deepcopy(kept_recording.environment))
