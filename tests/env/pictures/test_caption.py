"""What stands under a picture, by hand."""

from tests.conftest import small_world
from tests.env.pictures.worlds import drawn
from warp_torchrl.env.pictures.caption import progress
from warp_torchrl.world.arrays.batch import concatenated
from warp_torchrl.world.law.rate import RateFire
from warp_torchrl.world.mechanics.mechanic import Mechanic


class Loud(Mechanic):
    """A mechanic that says something of the first world."""

    name = "loud"

    def caption(self, state):
        """Return the number of its cells."""
        return (f"{state.cells[0].numel()} cells", "loud")


def test_the_forest_is_counted_where_no_mechanic_says_more():
    state = concatenated([drawn([[5, 5, 11, 5]]), drawn([[5, 5, 5, 5]])])  # of four trees one burns in the first
    assert progress(state, small_world()) == "step 0 of 40:  75% saved, 25% burning"
    assert progress(state, small_world(mechanics=(Loud(),))) == "step 0 of 40:  4 cells, loud"


def test_laws_in_minutes_have_a_clock():
    state = drawn([[5, 5, 11, 5]])
    state = state.replace(step=state.step + 7, tick=state.tick + 21)
    world = small_world(fire=RateFire(minutes_per_tick=3.5))
    assert progress(state, world).startswith("step 7 of 40, 1 h 14 min:")  # 73.5 minutes
