"""The command board: a table of the rows of a board, best first."""

from collections.abc import Sequence
from math import sqrt
from pathlib import Path

import numpy as np

from warp_torchrl.commands.board.knowledge import MEANING
from warp_torchrl.commands.board.rows import Row, read_row
from warp_torchrl.commands.board.tasks import Board, Task, boards, read_board
from warp_torchrl.commands.program import run_program, tell
from warp_torchrl.evaluation.statistics import compare, summarise
from warp_torchrl.evaluation.units import headed, sign_of, written
from warp_torchrl.runs.config.construction import ConfigError

USAGE = "warp board [ROW.json|FOLDER ...]"
_ABOUT = (
    f"usage: {USAGE}\n\nPrints the rows that warp submit wrote, best first, and by task the best team beside the best "
    "baseline that\nknows the same. Without a row it lists the boards and their tasks."
)
WORDS = (
    "points: mean over the tasks, 0 for noop and 100 for dispatch that knows what its team knows, with a 95 % interval "
    "over the fires; knows: " + "; ".join(f"{word}, {meaning}" for word, meaning in MEANING.items()) + "."
)
"""What the words of the table mean."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the board of the command line's rows, and return the exit code."""
    return run_program(arguments, _ABOUT, _run)


def _run(arguments: Sequence[str]) -> None:
    if not arguments:
        tell("\n\n".join(board_lines(read_board(name)) for name in boards()))
        return
    rows = [read_row(path) for path in _files(arguments)]
    names = list(dict.fromkeys(row.board for row in rows))
    tell("\n\n".join(board_table(read_board(name), [row for row in rows if row.board == name]) for name in names))


def _files(arguments: Sequence[str]) -> list[Path]:
    paths = [Path(each) for each in arguments]
    found = [file for path in paths for file in (sorted(path.glob("*.json")) if path.is_dir() else [path])]
    if not found:
        raise ConfigError(f"{', '.join(arguments)} hold no row: warp submit POLICY writes one")
    return found


def board_lines(board: Board) -> str:
    """Return the tasks of a board as a Markdown table."""
    lines = [
        f"**{board.name}**: {_told(board)}",
        "",
        "| task | asks | scenario | fires | rules |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| `{task.name}` | {task.about} | `{task.scenario}` | {task.fires} | `{task.rules}` |"
        for task in board.tasks.values()
    ]
    return "\n".join(lines)


def task_lines(board: Board, row: Row) -> list[str]:
    """Return what a row reached, a line for each task."""
    lines = []
    for name, played in row.tasks.items():
        task, (low, high) = board.tasks[name], summarise(np.array([played.values]))["ci95"]
        mean, ends = written(played.mean, played.metric), (written(each, played.metric) for each in (low, high))
        head = headed(played.metric, played.goal)
        lines.append(f"{name:<18}{head:<16}{mean:>7}  {' .. '.join(ends):<16}{task.points(played.mean):7.1f} points")
    return lines


def board_table(board: Board, rows: Sequence[Row]) -> str:
    """Return the rows of a board, best first, and by task the best team beside the best baseline that knows the same.

    Rows whose trainings took more than the budget stand below the others; last, without points, those that lack a task
    or fires, or that played other rules.

    Args:
        board: The board.
        rows: Its rows.
    """
    whole = [row for row in rows if is_whole(board, row)]
    whole.sort(key=lambda row: (not within(board, row), -points(board, row)[0]))
    others = [row for row in rows if row not in whole]
    heads = [f"`{name}`" for name in board.tasks]
    lines = [
        f"**{board.name}**: {', '.join(f'{task.name} in {_unit(task, rows)}' for task in board.tasks.values())}",
        "",
        "| row | knows | steps | minutes | points | 95 % | " + " | ".join(heads) + " |",
        "|---" * (6 + len(heads)) + "|",
    ]
    for row in [*whole, *others]:
        value, error = points(board, row) if row in whole else (float("nan"), float("nan"))
        ends = " .. ".join(_short(each) for each in (value - error, value + error))
        shown = [_short(value), ends] if row in whole else ["-", "-"]
        steps = "-" if row.steps is None else f"{row.steps:,}"
        minutes = "-" if row.minutes is None else f"{row.minutes:,.0f}"
        name = row.name.replace("|", "\\|") + ("" if within(board, row) else " (over the budget)")
        known = " ".join(dict.fromkeys(played.knowledge for played in row.tasks.values()))
        cells = [_mean(row, task) for task in board.tasks.values()]
        lines.append("| " + " | ".join([name, known, steps, minutes, *shown, *cells]) + " |")
    return "\n".join([*lines, "", f"Budget: {_told(board)}; {WORDS}", *_leaders(board, whole)])


def _short(value: float) -> str:
    return f"{round(value, 1) + 0.0:.1f}"  # no -0.0


def _unit(task: Task, rows: Sequence[Row]) -> str:
    played = next((row.tasks[task.name] for row in rows if task.name in row.tasks), None)
    return "-" if played is None else f"{headed(played.metric, played.goal)}, {played.better} is better"


def _mean(row: Row, task: Task) -> str:
    played = row.tasks.get(task.name)
    if played is None:
        return "-"
    note = "" if played.rules == task.rules else " (other rules)"
    return written(played.mean, played.metric) + note


def is_whole(board: Board, row: Row) -> bool:
    """Return whether a row has every task of its board, by its rules, seeds and fires."""
    return set(row.tasks) == set(board.tasks) and all(
        (played.rules, played.first_seed, len(played.values)) == (task.rules, task.first_seed, task.fires)
        for task, played in ((board.tasks[name], played) for name, played in row.tasks.items())
    )


def within(board: Board, row: Row) -> bool:
    """Return whether the trainings of a row took no more than the budget of its board."""
    return board.budget.allows(row.steps, row.minutes)


def _told(board: Board) -> str:
    return f"a team has {board.budget.steps:,} world steps and {board.budget.minutes:,.0f} minutes to train"


def points(board: Board, row: Row) -> tuple[float, float]:
    """Return a whole row's points, and half of their 95 % interval: 1.96 standard errors over the fires."""
    each = [(task.points(row.tasks[name].mean), _error(task, row)) for name, task in board.tasks.items()]
    count = len(each)
    return sum(value for value, _ in each) / count, 1.96 * sqrt(sum(error**2 for _, error in each)) / count


def _error(task: Task, row: Row) -> float:
    """Return the standard error of a row's points in a task."""
    values = np.array(row.tasks[task.name].values)
    scale = abs(100.0 / (task.reference - task.noop))
    return scale * float(values.std(ddof=1)) / sqrt(len(values)) if len(values) > 1 else 0.0


def _best(rows: Sequence[Row], task: Task) -> Row:
    return max(rows, key=lambda row: task.points(row.tasks[task.name].mean))


def _leaders(board: Board, rows: Sequence[Row]) -> list[str]:
    """Return a table of the best team and the best baseline of each task and knowledge."""
    lines = []
    for name, task in board.tasks.items():
        for known in MEANING:
            same = [row for row in rows if row.tasks[name].knowledge == known]
            teams, baselines = ([row for row in same if (row.steps is None) is kind] for kind in (False, True))
            if not teams or not baselines:
                continue
            team, baseline = (_best(each, task) for each in (teams, baselines))
            metric = team.tasks[name].metric
            mine, theirs = (np.array([row.tasks[name].values]) for row in (team, baseline))
            gap = compare(mine, theirs, metric.name, sign_of(metric))
            low, high = (written(end, metric, "+") for end in gap["ci95"])
            difference = written(gap[f"{metric.name}_difference"], metric, "+")
            lines.append(f"| `{name}` | {known} | {team.name} | {baseline.name} | {difference} | {low} .. {high} |")
    head = ["", "| task | knows | best team | best baseline | difference | 95 % |", "|---|---|---|---|---|---|"]
    return [*head, *lines] if lines else []
