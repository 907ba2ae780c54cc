"""Fused worlds are the eager ones: to the bit where the law has products, nearly so where it has exponentials."""

import pytest
import torch
from torch._inductor.cpp_builder import get_cpp_compiler
from torch._inductor.exc import InvalidCxxCompiler

from warp_torchrl import make_env
from warp_torchrl.world import fusion
from warp_torchrl.world.fusion import fusible, fusing

try:
    get_cpp_compiler()
except InvalidCxxCompiler:
    pytest.skip("no C++ compiler, so nothing can be fused", allow_module_level=True)

SMALL = ["landscape.size=12", "n_worlds=5", "horizon=40"]


def entries(state):
    found = state.to_tensordict().flatten_keys(".").items()
    return {name: value for name, value in found if isinstance(value, torch.Tensor)}


@pytest.mark.parametrize("overrides", [["fire=paper", "wind=wandering"], ["fire=spread", "landscape.relief=200"]])
def test_worlds_are_the_same_to_the_bit(overrides):
    eager = make_env("default", n_worlds=5, overrides=[*SMALL, *overrides])
    fused = make_env("default", n_worlds=5, overrides=[*SMALL, *overrides], compile=True)
    one, other = eager.reset(), fused.reset()
    burning = 0
    for _ in range(30):
        one = eager.rand_action(one)
        other["agents", "action"] = one["agents", "action"]
        (left, one), (right, other) = eager.step_and_maybe_reset(one), fused.step_and_maybe_reset(other)
        for name, value in entries(eager.world_state).items():
            assert torch.equal(value, entries(fused.world_state)[name]), name
        assert (left == right).all()
        burning += int(eager.world_state.tally.alight.sum())
    assert burning > 500


@pytest.mark.parametrize("overrides", [["landscape.relief=100"], ["wind=wandering"]])
def test_chances_of_the_hazard_law_are_the_same(overrides):
    env = make_env("hazard", n_worlds=4, overrides=[*SMALL, "ignition.head_start=20", *overrides])
    env.reset()
    fire, state = env.world.fire, env.world_state
    eager = fire.spread(state), fire.expected_ignitions(state)
    with fusing(True):
        fused = fire.spread(state), fire.expected_ignitions(state)
    for one, other in zip(eager, fused, strict=True):
        assert one.max() > 0.01
        torch.testing.assert_close(other, one, rtol=1e-6, atol=1e-7)


def test_nothing_is_fused_unless_asked():
    @fusible
    def twice(values):
        return values + values

    assert twice(torch.ones(2)).sum() == 4.0 and not fusion.is_fusing()
    with fusing(True), fusing(False):
        assert not fusion.is_fusing()


def test_a_missing_compiler_is_told(monkeypatch):
    def none() -> str:
        raise InvalidCxxCompiler

    monkeypatch.setattr("torch._inductor.cpp_builder.get_cpp_compiler", none)
    with pytest.raises(ValueError, match="compile must be false here"):
        make_env("single", n_worlds=1, compile=True)
