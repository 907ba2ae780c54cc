"""The state of the worlds: its tensors are of the types that the comments beside them tell."""

import inspect
import re

import pytest
from torch import Tensor

from tests.world.mechanics import of_mechanics
from tests.world.mechanics.there import can_play
from warp_torchrl import make_env
from warp_torchrl.world.arrays.batch import Batch, Named


def told(batch):
    """The types that the comments of a batch's class tell, by name."""
    sources = "".join(inspect.getsource(each) for each in type(batch).__mro__[:-1])
    return dict(re.findall(r"^    (\w+): Tensor.*?# (\w+) \[", sources, flags=re.MULTILINE))


def of_other_types(batch):
    """The tensors of a batch that are of another type than is told; a ``Named`` tells none of its own."""
    types, found, tells = told(batch), {}, not isinstance(batch, Named)
    for name, value in batch.parts():
        if isinstance(value, Batch):
            found |= {f"{name}.{inner}": each for inner, each in of_other_types(value).items()}
        elif tells and isinstance(value, Tensor) and str(value.dtype).removeprefix("torch.") != types.get(name):
            found[name] = value.dtype
    return found


@pytest.mark.parametrize(
    "overrides",
    [
        overrides
        for overrides in (
            ["scenario=water"],
            ["scenario=front"],
            ["scenario=smoke", "mechanics.radio.carries=map", "mechanics.radio.delay=2"],
            ["scenario=default", "fire=rate", "wind=wandering", "landscape.relief=50"],
            *of_mechanics("WORLDS").values(),
        )
        if can_play(overrides)
    ],
    ids=" ".join,
)
def test_tensors_are_of_the_types_that_are_told(overrides):
    env = make_env("default", n_worlds=2, overrides=overrides)
    env.reset()
    assert not of_other_types(env.world_state), "at the start"
    env.rollout(2)
    assert not of_other_types(env.world_state), "after steps"
