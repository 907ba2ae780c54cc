"""An environment is moved to a device as TorchRL's own are, whole, and plays there as one that was made there."""

import re
import types

import pytest
import torch
from tensordict.nn import TensorDictModule
from torchrl.collectors import Collector
from torchrl.envs import DeviceCastTransform, EnvBase, ParallelEnv, SerialEnv, TransformedEnv

from tests.conftest import small_world
from tests.env.scenarios import NAMES, WORLDS, env_of
from warp_torchrl.env import GroupedEnv, LeveledEnv, WildfireEnv
from warp_torchrl.env.reset_cache import ResetCache
from warp_torchrl.env.reset_pool import ResetPool

CUDA = [pytest.mark.cuda, pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")]
DEVICES = ["cpu:0", pytest.param("cuda", marks=CUDA)]
STEPS = 6


def tensors_of(thing, name="env"):
    """Yield all tensors that can be reached from an object, with the way to each."""
    seen, open_ends = set(), [(name, thing)]
    while open_ends:
        way, each = open_ends.pop()
        if id(each) in seen or isinstance(each, type | types.ModuleType):
            continue
        seen.add(id(each))
        if isinstance(each, torch.Tensor):
            yield way, each
        elif isinstance(each, dict):
            open_ends += [(f"{way}[{key!r}]", value) for key, value in each.items()]
        elif isinstance(each, list | tuple | set):
            open_ends += [(f"{way}[{at}]", value) for at, value in enumerate(each)]
        elif isinstance(each, types.MethodType):
            open_ends.append((f"{way}.__self__", each.__self__))
        elif isinstance(each, types.FunctionType):
            open_ends += [(f"{way}()", cell.cell_contents) for cell in each.__closure__ or ()]
        else:
            open_ends += [(f"{way}.{key}", value) for key, value in getattr(each, "__dict__", {}).items()]


RULES = re.compile(r"\.world\.|_check\.__self__")
"""The way to what a world's rules are made of: it holds no state, and is taken to the device at each start."""


def elsewhere(env, device):
    """The ways to tensors that are not on a device."""
    found = dict(tensors_of(env))
    assert len(found) > 20, "specs at least"
    away = [way for way, tensor in found.items() if tensor.device.type != torch.device(device).type]
    return [way for way in away if not RULES.search(way)]


POLICY = TensorDictModule(
    lambda mask: (mask * (torch.arange(mask.shape[-1], device=mask.device) * 7 % 11 + 1)).argmax(-1),
    in_keys=[("agents", "action_mask")],
    out_keys=[("agents", "action")],
)
"""Does the same on every device."""


def played(env, steps=STEPS):
    """What an environment shows in some steps, with episodes that end on the way, and after a reset of some worlds."""
    shown = env.rollout(steps, POLICY, break_when_any_done=False)
    ended = torch.arange(len(shown), device=env.device)[:, None] > 0
    return shown.cpu(), env.reset(shown[:, -1]["next"].clone().set("_reset", ended)).cpu()


def same(one, other):
    return all((a == b).all() for a, b in zip(one, other, strict=True))


def alike(one, other):
    """Whether two devices show the same: numbers with a point may differ in their last digit, others may not."""
    entries = {key: (each, other[key]) for key, each in one.items(include_nested=True, leaves_only=True)}
    return entries.keys() == set(other.keys(include_nested=True, leaves_only=True)) and all(
        torch.allclose(a, b, atol=1e-6) if a.is_floating_point() else torch.equal(a, b) for a, b in entries.values()
    )


@pytest.fixture
def meta(monkeypatch):
    """The one further device of a CPU, which holds no numbers: TorchRL's specs cannot be moved there, so they stay."""

    def moved(env, device):
        env._device = torch.device(device)
        return env

    monkeypatch.setattr(EnvBase, "to", moved)
    return "meta"


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("name", WORLDS)
def test_every_scenario_moves_with_all_that_it_keeps(maps, name, device, request):
    expected = played(env_of(name, maps, device=device))
    moved = env_of(name, maps)
    assert moved.to(device) is moved and moved.device.type == torch.device(device).type and not elsewhere(moved, device)
    assert same(played(moved), expected) and not elsewhere(moved, device)
    meta = request.getfixturevalue("meta")
    assert moved.to(meta) is moved and moved.world_state.cells.shape == (3, *moved.world.size)
    assert not [way for way in elsewhere(moved, meta) if not re.search(r"_spec|\.world\.|_check\.__self__", way)], (
        "a world is rules alone"
    )


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize(
    "name",
    [each if each in ("skirmish", "all of hetero") else pytest.param(each, marks=pytest.mark.slow) for each in NAMES],
)
def test_every_part_of_torchrl_moves_a_scenario(maps, name, device):
    expected = played(env_of(name, maps, device=device))
    cast = TransformedEnv(env_of(name, maps), DeviceCastTransform(device))
    assert all(map(alike, played(cast), expected))  # its worlds stay where they were
    serial = SerialEnv(2, lambda: env_of(name, maps), device=device)
    assert serial.rollout(2).device.type == serial.device.type == torch.device(device).type
    collector = Collector(env_of(name, maps), POLICY, frames_per_batch=6, total_frames=6, device=device)
    batch = next(iter(collector)).exclude("collector").cpu()
    assert (batch == expected[0][:, :2]).all()
    wide = env_of(name, maps).full_observation_spec.to(torch.float64)
    assert {leaf.dtype for leaf in wide.values(True, True)} == {torch.float64}


def test_what_a_collector_keeps_is_loaded_again(maps):
    kept = Collector(env_of("default", maps), POLICY, frames_per_batch=6, total_frames=18)
    frames = next(iter(kept)).numel()
    again = Collector(env_of("default", maps), POLICY, frames_per_batch=6, total_frames=18)
    again.load_state_dict(kept.state_dict())
    assert sum(batch.numel() for batch in again) == 18 - frames
    kept.shutdown(), again.shutdown()


@pytest.mark.parametrize("device", DEVICES)
def test_an_episode_goes_on_where_it_was(make_small_env, device):
    there, here = make_small_env(), make_small_env()
    for env in (there, here):
        played(env)
    there.to(device)
    assert alike(here._observe(), there._observe().cpu())
    assert all(map(alike, played(here), played(there)))
    assert not elsewhere(there, device)


@pytest.mark.slow
def test_workers_have_their_worlds_on_the_device_that_is_asked_for(make_small_env):
    expected = make_small_env(2).rollout(2, POLICY)
    env = ParallelEnv(2, lambda: make_small_env(2), device="cpu:0")
    try:
        found = env.rollout(2, POLICY)
    finally:
        env.close(raise_if_closed=False)
    assert found.device.type == "cpu" and all((each == expected).all() for each in found)


def test_levels_and_groups_move(meta):
    levels = LeveledEnv([small_world(horizon=3), small_world(horizon=5)], n_worlds=4)
    levels.draw_by([0.5, 0.5])
    groups = GroupedEnv(WildfireEnv(small_world(), n_worlds=4))
    for env in (levels, groups):
        env.rollout(4, break_when_any_done=False)
        assert env.to(meta) is env and env.device.type == meta
        assert all("_spec" in way for way in elsewhere(env, meta))


def test_an_environment_reads_freely_where_its_device_is_read_freely(make_small_env, meta):
    env, told = make_small_env(), make_small_env(validate=True)
    assert env.validate and isinstance(env._resets, ResetCache)
    for each in (env, told):
        each.to(meta)
    assert not env.validate and told.validate and isinstance(env._resets, ResetPool)


def test_to_where_it_is_keeps_what_lies_ready(make_small_env):
    env = make_small_env()
    played(env)
    ready = env._resets
    assert env.to("cpu") is env and env._resets is ready
