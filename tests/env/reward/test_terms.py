"""Terms of the adaptive reward by hand, and a user's own."""

import pytest
import torch

from tests.env.reward.drawing import EAST, EXTINGUISH, FIELD, STAY, drawn, earned
from warp_torchrl.env.reward import Adaptive
from warp_torchrl.env.reward.terms import TERMS, term
from warp_torchrl.world.backends.tick import in_wind

ALONE = {"scale": 1.0, "shaping": 0.0, "downwind": 0.0, "exposed": 0.0, "contained": 0.0, "extinguished": 1.0}


def of(name, state, world, *actions):
    """Return what a term of weight 1 adds to the first agent's reward: the forest itself pays 1 / 16 for a tree."""
    paid = earned(Adaptive(**ALONE, terms={name: 1.0}), state, world, *actions)[0]
    return paid - earned(Adaptive(**ALONE), state, world, *actions)[0]


def test_the_front_is_what_burns_beside_fuel():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    assert of("front", state, world, STAY, STAY) == pytest.approx(0.0)
    assert of("front", state, world, EXTINGUISH, STAY) == pytest.approx(1 / 16), "one of 16 trees burned"


def test_a_fire_without_fuel_beside_it_has_no_front():
    state, world = drawn(["F~TT", "~~TT", "TTTT", "TTTT"], [[1, 2], [3, 3]])
    state = state.replace(vehicles=state.vehicles.replace(position=torch.tensor([[[0, 0], [3, 3]]])))
    assert of("front", state, world, EXTINGUISH, STAY) == pytest.approx(0.0)


def test_a_fire_is_surrounded_from_eight_sides():
    # The fire at (1, 1): both agents stand in the north-west, then one of them in the north.
    state, world = drawn(FIELD, [[0, 0], [0, 0]])
    assert of("surrounded", state, world, STAY, STAY) == pytest.approx(0.0)
    assert of("surrounded", state, world, EAST, STAY) == pytest.approx(1 / 8)
    assert of("surrounded", state, world, EXTINGUISH, STAY) == pytest.approx(7 / 8), "nothing burns: 1"


def test_the_head_is_downwind():
    # Wind to the east: at (0, 0), west of the fire, nobody is at its head; at (0, 1), abreast, one of two is.
    state, world = drawn(FIELD, [[0, 0], [1, 0]])
    state = in_wind(state, world.fire, torch.tensor([4.0, 0.0])[None, :, None, None])
    assert of("head", state, world, EAST, STAY) == pytest.approx(1 / 2)
    assert of("head", state, world, STAY, STAY) == pytest.approx(0.0)


def test_weights_add_up():
    state, world = drawn(FIELD, [[0, 0], [3, 3]])
    both = earned(Adaptive(**ALONE, terms={"front": 2.0, "surrounded": -1.0}), state, world, EXTINGUISH, STAY)[0]
    assert both == pytest.approx(1 / 16 + 2 / 16 - 6 / 8)


def test_a_term_of_ones_own_is_chosen_by_name():
    @term("burnt_out")
    def burnt_out(transition):
        return (transition.counts_before.burned - transition.counts_after.burned) / transition.counts_before.initial

    try:
        state, world = drawn(FIELD, [[0, 0], [3, 3]], steps_per_tick=1)
        old = state.replace(cells=torch.where(state.cells == 11, 15, state.cells).to(torch.uint8))
        assert of("burnt_out", old, world, STAY, STAY) == pytest.approx(-1 / 16)
        term("burnt_out")(burnt_out)  # read again, as in a notebook
        with pytest.raises(ValueError, match="front must be a new term's name, warp_torchrl"):
            term("front")(burnt_out)
    finally:
        del TERMS["burnt_out"]


@pytest.mark.parametrize(
    ("terms", "message"),
    [
        ({"frnt": 0.1}, "terms must be of front, surrounded, head, got frnt: did you mean front?"),
        ({"front": float("nan")}, "terms.front must be in"),
        ({"front": True}, "terms.front must be a number, got True"),
        ({"front": "much"}, "terms.front must be a number, got 'much'"),
        (["front"], "terms must be a mapping"),
    ],
)
def test_mistakes_are_one_line(terms, message):
    with pytest.raises(ValueError, match=message.replace("?", r"\?")):
        Adaptive(terms=terms)


def test_weights_of_terms_have_a_limit_that_is_theirs():
    assert Adaptive(terms={"front": 1e9}).terms == {"front": 1e9}
    with pytest.raises(ValueError, match=r"terms\.front must be in"):
        Adaptive(terms={"front": 1e9 + 1.0})
