"""The command submit: plays a policy on the tasks of a board and writes its row."""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path

import torch

from warp_torchrl import __version__
from warp_torchrl.api.evaluate import composed_evaluation, evaluate
from warp_torchrl.commands.board.knowledge import knowledge_of
from warp_torchrl.commands.board.rows import Played, Row, read_row, write_row
from warp_torchrl.commands.board.table import task_lines
from warp_torchrl.commands.board.tasks import NEWEST, Board, Task, read_board
from warp_torchrl.commands.program import PLUGINS, command_help, run_program, tell
from warp_torchrl.evaluation.cache import code_digest
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.runs.checkpoint import Checkpoint
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.construction import ConfigError, construct
from warp_torchrl.runs.config.grammar import own_values
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.history import history_line, trained_minutes, trained_steps
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.system.shipped import policy_names
from warp_torchrl.training.run import newest
from warp_torchrl.validation import check_fields, did_you_mean

log = logging.getLogger("warp_torchrl")
USAGE = "warp submit POLICY [belief=ensemble] [KEY=VALUE ...]"
_MAY = ("belief",)
"""Groups of a world that a team may choose: what it makes of what it has seen."""
_DIGITS = 16


@dataclass(frozen=True, kw_only=True)
class SubmitOptions:
    """Options of ``warp submit``.

    Attributes:
        board: The list of tasks.
        tasks: Those that are played; None: all. A row of some tasks has no place in the order of the board.
        fires: Worlds of each task; None: as many as the board says. A row of fewer has no place either.
        name: Name of the row; None: the policy's.
        out: File of the row; None: ``NAME.json`` in this folder.
        check: A row that is played again: its file is compared with what this machine finds, and nothing is written.
        overwrite: Whether a file there may be replaced.
    """

    board: str = NEWEST
    tasks: tuple[str, ...] | None = None
    fires: int | None = None
    name: str | None = None
    out: str | None = None
    check: str | None = None
    overwrite: bool = False

    def __post_init__(self) -> None:
        check_fields(self, fires=(1, 100_000))


def main(arguments: Sequence[str] | None = None) -> int:
    """Play the policy of the command line on a board, and return the exit code."""
    more = (PLUGINS, "POLICY: a baseline's name, a run folder, a checkpoint, a shipped policy, or hf://OWNER/NAME")
    return run_program(arguments, command_help(USAGE, SubmitOptions, more=more), _run)


def _run(arguments: Sequence[str]) -> int:
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    policy, options, chosen = read_options(arguments)
    _check_name(policy)
    board = read_board(options.board)
    tasks = board.chosen(options.tasks)
    against = None if options.check is None else read_row(Path(options.check))
    name = options.name or Path(policy).name
    path = Path(options.out or f"{name}.json")
    if against is None and path.exists() and not options.overwrite:
        raise ConfigError(f"out: {path} exists; take another file, or overwrite=true")
    row = play_board(board, tasks, policy, name, chosen, options.fires)
    tell("\n".join(task_lines(board, row)))
    if against is not None:
        return _compare(row, against)
    write_row(path, row)
    log.info("wrote %s, seal %s", path, row.seal[:_DIGITS])
    return 0


def read_options(arguments: Sequence[str]) -> tuple[str, SubmitOptions, tuple[str, ...]]:
    """Return the policy, the options, and the overrides of a command line.

    Raises:
        ConfigError: If a word fits none of them; the tasks' rules are frozen.
    """
    policies = [each for each in arguments if "=" not in each and not each.startswith("-")]
    if len(policies) != 1:
        raise ConfigError(f"give one policy: {USAGE}")
    names = [each.name for each in fields(SubmitOptions)]
    rest = [each for each in arguments if each != policies[0] and not each.startswith("plugins=")]
    values, chosen = own_values(rest, names, ("name", "out", "check", "board"))
    for each in chosen:
        key = each.partition("=")[0]
        if key.partition(".")[0] not in _MAY:
            hint = did_you_mean(key, [*names, *_MAY])
            raise ConfigError(f"{key}: the rules of a board's tasks are frozen; a team chooses belief alone{hint}")
    options: SubmitOptions = construct(SubmitOptions, values, "")
    return policies[0], options, chosen


def _check_name(policy: str) -> None:
    """Check that a single word names a baseline, a shipped policy or a folder.

    Raises:
        ConfigError: If it names none.
    """
    known = [*HEURISTICS, *policy_names()]
    if policy not in known and len(Path(policy).parts) == 1 and not Path(policy).exists():
        raise ConfigError(f"{policy} is no baseline, shipped policy or folder{did_you_mean(policy, known)}")


def play_board(
    board: Board, tasks: Sequence[Task], policy: str, name: str, chosen: Sequence[str] = (), fires: int | None = None
) -> Row:
    """Play a policy on tasks of a board, and return its row.

    Args:
        board: The board.
        tasks: Those of its tasks that are played.
        policy: A baseline's name, or where a trained policy is.
        name: Name of the row.
        chosen: Overrides beside the tasks' own.
        fires: Worlds of each task; None: as the task says.

    Raises:
        ConfigError: If a task's rules are not the board's in this version, or the policy does not fit.
        CheckpointError: If the policy is not sound.
    """
    for task in tasks:
        if task.found_rules != task.rules:
            rules = f"{task.found_rules}, than {board.name} froze, {task.rules}"
            raise ConfigError(f"{task.name}: this version plays other rules, {rules}")
    found = None if policy in HEURISTICS else newest(find_policy(policy))
    return Row(
        board=board.name,
        name=name,
        policy=f"baseline {policy}" if found is None else _hash_of(found),
        trained="" if found is None else history_line(found.history),
        steps=None if found is None else trained_steps(found.history),
        minutes=None if found is None else trained_minutes(found.history),
        code=code_digest()[:_DIGITS],
        made={"day": f"{datetime.now(UTC):%Y-%m-%d}", "warp_torchrl": __version__, "torch": torch.__version__},
        options=tuple(chosen),
        tasks={task.name: _play(task, policy, chosen, fires) for task in tasks},
    )


def _play(task: Task, policy: str, chosen: Sequence[str], fires: int | None) -> Played:
    log.info("playing %s, %d fires", task.name, fires or task.fires)
    seeds = (f"evaluation.first_seed={task.first_seed}", f"evaluation.episodes={fires or task.fires}")
    own = chosen if task.world.sensing.is_limited else ()  # where agents see all there is nothing to believe
    overrides = [*task.overrides, *own, *seeds, "evaluation.baselines=[]"]
    result = evaluate(policy, task.scenario, overrides=overrides, picture=None)
    config, _ = composed_evaluation(policy, [f"scenario={task.scenario}", *overrides])
    knowledge = knowledge_of(run_config(plain(config)), policy if policy in HEURISTICS else None)
    return Played(
        rules=task.rules,
        goal=result.goal.name,
        better=result.goal.better,
        unit=result.goal.unit,
        first_seed=task.first_seed,
        knowledge=knowledge,
        values=tuple(float(each) for each in result.episodes[result.goal.name]),
    )


def _hash_of(found: Checkpoint) -> str:
    """Return a hash of a policy's files that play: its weights, and its configuration."""
    digest = sha256()
    for file in ("policy.pt", "policy.safetensors", "config.json"):
        path = found.path / file
        if path.is_file():
            digest.update(file.encode() + path.read_bytes())
    return digest.hexdigest()[:_DIGITS]


def _compare(row: Row, against: Row) -> int:
    """Print how a row that was played again differs, and return the exit code: 0 where it does not."""
    differ = [
        name
        for name, played in row.tasks.items()
        if name not in against.tasks or against.tasks[name].values[: len(played.values)] != played.values
    ]
    same_policy = "the same policy" if row.policy == against.policy else "another policy"
    tell(f"{same_policy}; tasks that differ: {', '.join(differ) or 'none'}")
    return 1 if differ or row.policy != against.policy else 0
