"""Rules of flight in play: what agents are shown, what heuristics mind, what rewards and tables tell."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from tests.env.reward.drawing import FIELD, drawn
from warp_torchrl import load_policy, make_env
from warp_torchrl.env.metrics import metrics
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import environment_config, restore, world_overrides
from warp_torchrl.world.mechanics.flight.flight import Aircraft, Flight
from warp_torchrl.world.state.cells import count_trees
from warp_torchrl.world.team.team import Team

GOLDEN = Path(__file__).parents[3] / "golden" / "0.1.0"


def test_a_battery_is_shown_where_it_runs_down():
    scouts = ["observation=surroundings", "team.roles=[scout,ugv]", "landscape.size=32"]
    plain = make_env("default", n_worlds=2, overrides=scouts)
    env = make_env("default", n_worlds=2, overrides=[*scouts, "mechanics.flight.battery=10"])
    names = env.channel_names["status"]
    assert names == (*plain.channel_names["status"], "battery")
    now = env.reset()
    policy = HEURISTICS["oldest"](env)
    for _ in range(3):
        now = env.step(policy(now))["next"]
    shown = now["agents", "observation", "status"][..., -1]
    assert torch.equal(shown, env.world_state.plane("flight", "battery") / 10.0)
    assert shown[0].tolist() == pytest.approx([0.7, 1.0, 0.7, 1.0])  # scouts fly, bulldozers do not


def test_an_older_policy_plays_on_beside_a_battery():
    policy = load_policy(GOLDEN, mode="deterministic")
    played = [
        env.rollout(12, policy.fitted(env), break_when_any_done=False)["agents", "action"]
        for env in (
            make_env("skirmish", n_worlds=4, overrides=[*policy.overrides, *further])
            for further in ([], ["mechanics.flight.battery=9"])  # bulldozers do not fly
        )
    ]
    assert torch.equal(*played)


@pytest.mark.parametrize("name", ["oldest", "lawnmower", "follower"])
def test_aircraft_turn_back_before_their_batteries_are_empty(name):
    overrides = ["team.roles=[scout]", "team.n_agents=3", "landscape.size=24", "mechanics.flight.battery=16"]
    env = make_env("default", n_worlds=4, overrides=[*overrides, "steps_per_tick=12", "ignition.region=1.0"])
    policy, now, lowest, charged = HEURISTICS[name](env), env.reset(), 16, False
    for _ in range(40):
        before = env.world_state.plane("flight", "battery")
        now = env.step(policy(now))["next"]
        battery = env.world_state.plane("flight", "battery")
        lowest = min(lowest, int(battery.min()))
        charged |= bool(((battery == 16) & (before < 8)).any())
    assert 0 < lowest < 16 and charged


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("mechanics.flight.battery=0", r"^mechanics\.flight\.battery must be in"),
        ("mechanics.flight.battery=1.5", r"^mechanics\.flight\.battery must be a whole number or null, got 1\.5"),
        ("mechanics.fligth.drift=0.1", r"^mechanics must be some of .*flight.*, got fligth: did you mean flight"),
        (
            "mechanics.flight.dirft=0.1",
            r"^mechanics\.flight\.dirft is not a key .*: did you mean .*drift",
        ),
    ],
)
def test_mistakes_are_told_in_one_line(override, message):
    with pytest.raises(ConfigError, match=message):
        run_config(plain(compose_config("train", [override])))


def test_rules_of_flight_are_recorded_whole_and_restored():
    values = plain(compose_config("train", ["scenario=hetero", "mechanics.flight.battery=9"]))
    record = environment_config(values)
    assert record.values["mechanics"]["flight"] == {"battery": 9}
    assert plain(restore(record))["mechanics"] == record.values["mechanics"]
    assert plain(restore(record, ["mechanics.flight.battery=5"]))["mechanics"]["flight"]["battery"] == 5
    assert world_overrides(values) == ["mechanics.flight.battery=9"]
    bare = plain(compose_config("train", ["mechanics={flight:{}}"]))
    assert world_overrides(bare) == ["mechanics.flight={}"] and Flight() in run_config(bare).world.mechanics
    assert Flight() in run_config(plain(restore(environment_config(bare)))).world.mechanics
    assert plain(compose_config("train", world_overrides(bare)))["mechanics"]["flight"] == {}


def apart(positions):
    """Worlds drawn by hand whose two scouts must keep two cells apart."""
    state, world = drawn(FIELD, positions)
    team = Team(n_agents=2, roles=("scout",), start="anywhere")
    world = replace(world, team=team, mechanics=(Flight(separation=2.0),))
    return world.mechanics[0].begin(state, world), world


def test_near_misses_are_a_share_of_the_agents_steps():
    state, world = apart([[3, 2], [3, 3]])
    misses = state.planes("flight", Aircraft).replace(near_misses=torch.tensor([[5, 3]], dtype=torch.int32))
    state = state.replace(step=torch.tensor([8], dtype=torch.int32)).with_planes("flight", misses)
    assert metrics(state, count_trees(state), world)["near_misses"].tolist() == [8 / 16]
    env = make_env("hetero", n_worlds=2, overrides=["mechanics.flight.separation=2.0"])
    assert env.rollout(2)["next", "info", "near_misses"].shape == (2, 2, 1)
