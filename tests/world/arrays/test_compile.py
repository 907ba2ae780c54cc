"""Fused worlds are the eager ones to the bit, but for the last places of exponentials, and of sums in what is seen."""

from itertools import cycle

import pytest
import torch
from torch._inductor.cpp_builder import get_cpp_compiler
from torch._inductor.exc import InvalidCxxCompiler

from tests.world.mechanics import of_mechanics
from warp_torchrl import make_env
from warp_torchrl.env import scene
from warp_torchrl.system.compiler import FEW_CELLS, compiled
from warp_torchrl.world.arrays import compile as operators
from warp_torchrl.world.arrays.compile import opaque_op
from warp_torchrl.world.backends.tick import advance
from warp_torchrl.world.state.cells import count_trees
from warp_torchrl.world.state.flags import in_bytes, in_flags

try:
    get_cpp_compiler()
except InvalidCxxCompiler:
    pytest.skip("no C++ compiler, so nothing can be fused", allow_module_level=True)

SMALL = ["landscape.size=[10,12]", "n_worlds=5", "horizon=40"]
BRIEFLY = ["fire=spread", "landscape.relief=200", "steps_per_tick=1", "team.n_agents=2", "reward.shaping=0.5"]
AT_LENGTH = [
    ["fire=paper", "wind=wandering", "fire.growth=true", "fire.beta=50", "fire.p_regrow=0.05", "fire.wet_ticks=2"],
    ["fire=hazard", "landscape.relief=100", "wind=wandering", "team.roles=[ugv,uav]", "team.tank=3", "reward=time"],
    ["fire=paper", "observation=paper", "team.allow_stay=false", "team.extinguish_p=0.5", "reward=paper"],
    [
        *("fire=spread", "landscape.size=[9,16]", "fire.neighbours=4", "reward=collaborative"),
        *("observation=surroundings", "observation.centred=false"),
    ],
    ["observation=local", "observation.ways=[fire,share]", "observation.water=true"],
    *map(list, of_mechanics("WORLDS").values()),
]


@pytest.mark.slow
def test_a_tick_is_the_same():
    env = make_env("default", n_worlds=5, overrides=[*SMALL, *BRIEFLY])
    env.reset()
    eager, world = env.world_state, env.world
    fused, begun, each = in_bytes(eager), eager, torch.ones(5, dtype=torch.bool)
    for _ in range(20):
        eager = advance(eager, world.fire, world.air, each)
        fused = compiled(advance)(fused, world.fire, world.air, each)
        told = in_flags(fused).leaves()
        for name, value in eager.leaves().items():
            assert torch.equal(told[name], value) and told[name].dtype == value.dtype, name
    assert (eager.cells != begun.cells).sum() > 100


@pytest.mark.slow  # they take as long as fifty others to compile; `.ci/run compile` plays the first
@pytest.mark.parametrize(("overrides", "few_cells"), [*zip([BRIEFLY, BRIEFLY, *AT_LENGTH], cycle((FEW_CELLS, 0)))])
def test_worlds_are_the_same_in_one_function_and_in_two(overrides, few_cells, monkeypatch):
    for each in (scene, operators):
        monkeypatch.setattr(each, "FEW_CELLS", few_cells)
    exponentials = "fire=hazard" in overrides or "wind=wandering" in overrides
    names = [each.removeprefix("scenario=") for each in overrides if each.startswith("scenario=")]
    scenario, further = (names or ["default"])[0], [*SMALL, *overrides[len(names) :]]
    eager, fused = (make_env(scenario, n_worlds=5, overrides=further, compile=each) for each in (False, True))
    one, other = eager.reset(), fused.reset()
    burning = 0
    for _ in range(50):  # past the horizon: some worlds start again
        one = eager.rand_action(one)
        other["agents", "action"] = one["agents", "action"]
        (left, one), (right, other) = eager.step_and_maybe_reset(one), fused.step_and_maybe_reset(other)
        worlds = fused.world_state.leaves()
        for name, value in eager.world_state.leaves().items():
            assert value.dtype == worlds[name].dtype
            if exponentials and value.is_floating_point():
                torch.testing.assert_close(worlds[name], value, rtol=1e-5, atol=1e-6)
            else:
                assert torch.equal(value, worlds[name]), name
        for name, value in left.items(include_nested=True, leaves_only=True):
            torch.testing.assert_close(right[name], value, rtol=1e-5, atol=1e-6)
        burning += int(eager.tree_counts.alight.sum())
    assert burning > 500


def test_worlds_in_bytes_are_the_worlds():
    state = make_env("default", n_worlds=2, overrides=SMALL).world.reset(torch.arange(2), torch.zeros(2).long())
    told = in_bytes(state)
    assert told.initial.dtype == torch.uint8 and told.initial.data_ptr() == state.initial.data_ptr()
    back = in_flags(told).leaves()
    for name, value in state.leaves().items():
        assert torch.equal(back[name], value) and back[name].dtype == value.dtype
    assert torch.equal(count_trees(told).initial, count_trees(state).initial)


def test_a_function_is_compiled_once_for_all_who_ask():
    assert compiled(count_trees) is compiled(count_trees)
    assert compiled(count_trees) is not compiled(count_trees, in_parts=True)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("counting", (7, torch.zeros(2))),
        ("splitmix64", (torch.arange(5),)),
        ("in_a_row", (torch.ones(2, 3, 4, dtype=torch.uint8),)),
        ("squares", (torch.ones(2, 6, 5, dtype=torch.int32), torch.tensor([[[0, 4]], [[5, 1]]]), 2)),
        ("stacked", ([torch.ones(2, 3, 5, 5), torch.zeros(2, 3, 5, 5)],)),
    ],
)
def test_what_is_opaque_op_is_what_the_compiler_is_told(name, arguments):
    operator = getattr(torch.ops.warp_torchrl, name).default
    torch.library.opcheck(operator, arguments, test_utils=("test_schema", "test_faketensor"))


def test_a_module_that_keeps_something_in_memory_may_be_imported_again():
    for factor in (2.0, 3.0):

        @opaque_op("(Tensor given) -> Tensor", like=torch.empty_like)
        def times(given):
            return given * factor  # noqa: B023, used before the next

        assert torch.compile(times, backend="eager", fullgraph=True)(torch.ones(1)).item() == factor


def test_a_missing_compiler_is_told(monkeypatch):
    def none() -> str:
        raise InvalidCxxCompiler

    monkeypatch.setattr("torch._inductor.cpp_builder.get_cpp_compiler", none)
    with pytest.raises(ValueError, match="compile must be false here"):
        make_env("single", n_worlds=1, compile=True)
