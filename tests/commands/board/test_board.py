"""Rows of a board, and their table."""

import json
from dataclasses import replace

import pytest

from tests.world.mechanics.there import needs
from warp_torchrl.commands.board import submit, table, tasks
from warp_torchrl.commands.board.rows import Played, Row, read_row, write_row
from warp_torchrl.commands.board.table import board_table, is_whole, points
from warp_torchrl.commands.board.tasks import Board, Budget, Task
from warp_torchrl.runs.config.construction import ConfigError


def a_task(name: str, **changes: object) -> Task:
    given = {"board": "small", "about": "", "scenario": "skirmish", "fires": 2, "noop": 0.0, "reference": 0.5}
    overrides = ("horizon=12", "landscape.size=12")
    world = tasks.world_of("skirmish", overrides)
    return Task(**{**given, "name": name, "overrides": overrides, "rules": tasks.rules_of(world), **changes})


SMALL = Board(
    name="small", budget=Budget(steps=1000, minutes=60.0), tasks={name: a_task(name) for name in ("one", "two")}
)


def a_row(name: str = "r", values: tuple[float, ...] = (0.2, 0.4), steps: int | None = None, **changes: object) -> Row:
    def played(task: Task) -> Played:
        words = {"goal": "saved", "better": "more", "unit": "%", "knowledge": "all"}
        return Played(rules=task.rules, first_seed=task.first_seed, values=values, **words)

    given = {"board": "small", "name": name, "policy": "p", "code": "c", "made": {"day": "2026-01-01"}, "steps": steps}
    return Row(**{**given, "tasks": {name: played(task) for name, task in SMALL.tasks.items()}, **changes})


def test_a_row_is_read_as_it_was_written(tmp_path) -> None:
    write_row(tmp_path / "r.json", a_row(options=("belief=ensemble",)))
    assert read_row(tmp_path / "r.json") == a_row(options=("belief=ensemble",))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda row: row["tasks"]["one"]["values"].__setitem__(0, 0.9), "was changed after it was written"),
        (lambda row: row.update(name="better"), "was changed after it was written"),
        (lambda row: row.update(name="a\nb"), "is no row of a board: names must be lines"),
        (lambda row: row.update(steps=-1), "is no row of a board: steps must be a whole number"),
        (lambda row: row.update(minutes="soon"), "is no row of a board: minutes must be a number"),
        (lambda row: row.pop("seal"), "is no row of a board: 'seal'"),
        (lambda row: row["tasks"]["one"].update(values=[]), "is no row of a board: values must be 1 to"),
        (lambda row: row["tasks"]["one"].update(knowledge="god"), "is no row of a board: better, unit and knowledge"),
        (lambda row: row.update(more=1), "is no row of a board: .*unexpected keyword"),
    ],
)
def test_a_row_that_was_changed_is_refused_in_one_line(change, told: str, tmp_path) -> None:
    path = tmp_path / "r.json"
    write_row(path, a_row())
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    with pytest.raises(ConfigError, match=told) as error:
        read_row(path)
    assert "\n" not in str(error.value)


def test_points_by_hand() -> None:
    # 0.3 of 0.5 in both tasks: 60 points. Deviation of (0.2, 0.4): 0.141421; error of a mean 0.1, 20 points; of the
    # mean of two tasks 20 sqrt(2) / 2 = 14.142, times 1.96.
    value, half = points(SMALL, a_row())
    assert value == pytest.approx(60.0)
    assert half == pytest.approx(1.96 * 14.1421, rel=1e-4)


def test_a_row_of_some_tasks_or_fires_or_other_rules_is_not_whole() -> None:
    whole = a_row()
    assert is_whole(SMALL, whole)
    fewer = replace(whole, tasks={"one": whole.tasks["one"]})
    shorter = a_row(values=(0.3,))
    other = replace(whole, tasks={**whole.tasks, "two": replace(whole.tasks["two"], rules="other")})
    assert not any(is_whole(SMALL, row) for row in (fewer, shorter, other))
    told = board_table(SMALL, [fewer, other, whole])
    assert told.splitlines()[4].startswith("| r | all | - | - | 60.0 |"), "the whole row is first"
    assert "30.0 (other rules)" in told


def test_the_best_team_stands_beside_the_best_baseline_that_knows_the_same() -> None:
    rows = [a_row("team", (0.5, 0.7), steps=100), a_row("worse", (0.1, 0.1), steps=9), a_row("dispatch", (0.4, 0.5))]
    told = board_table(SMALL, rows)
    assert "| `one` | all | team | dispatch | +15.0 | +10.0 .. +20.0 |" in told
    order = [line.split(" | ")[0] for line in told.splitlines()[4:7]]
    assert order == ["| team", "| dispatch", "| worse"]


def test_a_row_over_the_budget_stands_below_those_within_it() -> None:
    best = a_row("long", (0.9, 0.9), steps=1001)
    slow = a_row("slow", (0.8, 0.8), steps=9, minutes=60.1)
    rows = [best, slow, a_row("within", (0.1, 0.2), steps=1000, minutes=60.0), a_row("dispatch", (0.4, 0.5))]
    order = [line.split(" | ")[0] for line in board_table(SMALL, rows).splitlines()[4:8]]
    assert order == ["| dispatch", "| within", "| long (over the budget)", "| slow (over the budget)"]


@pytest.fixture
def small(monkeypatch):
    for module in (submit, table):
        monkeypatch.setattr(module, "read_board", lambda name=None: SMALL)


def test_a_policy_is_played_written_checked_and_shown(small, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert submit.main(["local"]) == 0
    row = read_row(tmp_path / "local.json")
    assert row.policy == "baseline local" and is_whole(SMALL, row)
    assert {played.knowledge for played in row.tasks.values()} == {"alone"}
    assert row.tasks["one"].values != row.tasks["two"].values, "tasks have seeds of their own"
    assert submit.main(["local"]) != 0
    assert "local.json exists" in capsys.readouterr().err
    assert submit.main(["local", "check=local.json", "fires=1"]) == 0
    assert "the same policy; tasks that differ: none" in capsys.readouterr().out
    assert submit.main(["noop", "check=local.json"]) == 1
    assert "another policy; tasks that differ: one, two" in capsys.readouterr().out
    assert table.main(["local.json"]) == 0
    assert "| local | alone | - |" in capsys.readouterr().out


def test_a_trained_policy_is_known_by_its_weights_and_its_trainings(small, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert submit.main(["skirmish", "tasks=[one]"]) == 0
    row = read_row(tmp_path / "skirmish.json")
    assert row.steps and "world steps" in row.trained and len(row.policy) == 16
    assert row.tasks["one"].knowledge == "all" and not is_whole(SMALL, row)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ([], "give one policy"),
        (["local", "wind.speed=0"], "wind.speed: the rules of a board's tasks are frozen"),
        (["local", "tasks=[three]"], "tasks of small are one, two, got three"),
        (["local", "fires=0"], "fires must be in"),
        (["dispach"], "dispach is no baseline, shipped policy or folder: did you mean dispatch?"),
        (["runs/no_such"], "no_such"),
        (["local", "check=no.json"], "no.json: No such file"),
    ],
)
def test_a_mistake_gets_one_line_and_writes_nothing(given, told, small, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert submit.main(given) != 0
    assert told in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@needs("belief", "radio", "sensing")
def test_a_belief_is_chosen_where_sight_is_limited(tmp_path) -> None:
    overrides = ("horizon=12", "landscape.size=12")
    search = a_task("two", scenario="search", overrides=overrides, rules="")
    search = replace(search, rules=search.found_rules)
    board = Board(name="small", budget=SMALL.budget, tasks={"one": SMALL.tasks["one"], "two": search})
    chosen = ("belief=ensemble", "belief.members=2", "belief.hidden=4")
    rows = [submit.play_board(board, [*board.tasks.values()], "oldest", "o", each, 1) for each in ((), chosen)]
    known = [[played.knowledge for played in row.tasks.values()] for row in rows]
    assert known == [["alone", "alone"], ["alone", "team"]]


def test_other_rules_are_not_played(tmp_path) -> None:
    with pytest.raises(ConfigError, match=r"one: this version plays other rules, \w{16}, than small froze, 0000"):
        submit.play_board(SMALL, [a_task("one", rules="0000")], "noop", "noop")


def test_boards_are_listed(capsys) -> None:
    assert table.main([]) == 0
    assert "**warp-v1**" in capsys.readouterr().out
