"""Frozen tasks: their rules, seeds and points."""

import pytest

from tests.world.mechanics.there import needs
from warp_torchrl.commands.board.tasks import Task, boards, read_board, rules_of, world_of
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.seeds import BEYOND_EVALUATION, FIRST_EVALUATED
from warp_torchrl.world.law.hazard import HazardFire
from warp_torchrl.world.world import World


def a_task(**changes: object) -> Task:
    given = {"board": "b", "name": "t", "about": "", "scenario": "skirmish", "rules": "", "fires": 4}
    return Task(**{**given, "noop": 0.2, "reference": 0.7, **changes})


@needs("arrivals", "breach", "embers", "lines", "radio", "sensing", "values")
@pytest.mark.parametrize("name", boards())
def test_every_task_is_played_by_the_rules_that_were_frozen(name: str) -> None:
    # Where it fails, a rule has changed: make a new board, and leave the rows of this one as they are.
    tasks = read_board(name).tasks
    assert {key: task.found_rules for key, task in tasks.items()} == {key: task.rules for key, task in tasks.items()}


@pytest.mark.parametrize("name", boards())
def test_seeds_of_tasks_are_apart_from_each_other_and_from_all_else(name: str) -> None:
    tasks = sorted(read_board(name).tasks.values(), key=lambda task: task.first_seed)
    ends = [task.first_seed + task.fires for task in tasks]
    assert all(end <= after.first_seed for end, after in zip(ends, tasks[1:], strict=False))
    assert tasks[0].first_seed > FIRST_EVALUATED + 2**32
    assert ends[-1] < BEYOND_EVALUATION


def test_rules_are_the_values_that_are_not_defaults() -> None:
    plain = rules_of(World())
    assert plain == rules_of(World(horizon=256)), "a default said aloud changes nothing"
    others = [World(horizon=255), World(fire=HazardFire()), World(fire=HazardFire(refinement=8))]
    assert len({plain, *map(rules_of, others)}) == 4


@needs("embers")
def test_mechanics_are_of_the_rules() -> None:
    assert rules_of(world_of("skirmish", ())) != rules_of(world_of("skirmish", ("mechanics.embers={}",)))


def test_points_go_from_noop_to_the_reference() -> None:
    assert [a_task().points(value) for value in (0.2, 0.45, 0.7, 0.8)] == pytest.approx([0.0, 50.0, 100.0, 120.0])
    escaped = a_task(noop=0.9, reference=0.4)  # less is better
    assert escaped.points(0.4) == pytest.approx(100.0) and escaped.points(0.3) == pytest.approx(120.0)


def test_the_first_seed_is_a_hash_of_board_and_task() -> None:
    assert a_task().first_seed == a_task(fires=9).first_seed
    assert len({a_task().first_seed, a_task(name="u").first_seed, a_task(board="c").first_seed}) == 3


@pytest.mark.parametrize(
    ("ask", "told"),
    [
        (lambda: read_board("warp-v2"), r"board must be one of .*warp-v1.*, got warp-v2"),
        (lambda: read_board().chosen(["gal"]), "tasks of warp-v1 are .*, got gal: did you mean gale"),
        (lambda: a_task(noop=0.7), "reference must be another number than noop"),
    ],
)
def test_what_is_not_there_gets_one_line(ask, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        ask()
    assert issubclass(ConfigError, ValueError)


@needs("embers", "lines", "radio")
def test_the_mixture_of_the_board_has_worlds_of_its_tasks() -> None:
    kinds = run_config(plain(compose_config("train", ["scenario=default", "mixture=warp_v1"]))).kinds
    tasks = read_board("warp-v1").tasks
    assert [rules_of(kind.world) for kind in kinds] == [tasks[kind.name].rules for kind in kinds]
