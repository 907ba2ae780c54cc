"""One command line: ``warp COMMAND ...``, or ``python -m warp_torchrl COMMAND ...``."""

import sys
from importlib import import_module

from warp_torchrl import register_environments
from warp_torchrl.system.exit_codes import DONE, MISTAKE
from warp_torchrl.system.foreign_text import plain_text
from warp_torchrl.validation import did_you_mean

COMMANDS = {
    "train": ("warp_torchrl.commands.command:train", "train a team"),
    "evaluate": ("warp_torchrl.commands.command:evaluate", "evaluate a policy beside the baselines"),
    "live": ("warp_torchrl.commands.live:main", "watch a team on a local page, and take part"),
    "demonstrations": ("warp_torchrl.commands.demonstrations:main", "list, check and export recordings"),
    "correct": ("warp_torchrl.commands.correct:main", "let a scripted person correct a policy"),
    "predict": ("warp_torchrl.commands.predict:main", "predict fires alone on real ground"),
    "score": ("warp_torchrl.commands.score:main", "score a predicted fire against what was seen to burn"),
    "calibrate": ("warp_torchrl.commands.calibrate:main", "score and fit the law of fires to observed ones"),
    "search": ("warp_torchrl.commands.search:main", "search values of a training's keys"),
    "keys": ("warp_torchrl.commands.usage:main", "tell what keys of worlds, teams and learners mean"),
    "summary": ("warp_torchrl.evaluation.summary:main", "summarise evaluations in one table"),
    "submit": ("warp_torchrl.commands.board.submit:main", "play a policy on the frozen tasks of a board"),
    "board": ("warp_torchrl.commands.board.table:main", "make the table of a board's rows"),
    "curves": ("warp_torchrl.commands.curves:main", "draw learning curves of runs"),
    "probe": ("warp_torchrl.commands.probe:main", "read a team's messages by linear probes"),
    "export": ("warp_torchrl.commands.export:main", "export a trained policy"),
    "benchmark": ("warp_torchrl.benchmark.__main__:main", "measure speed and difficulty on this machine"),
}
"""Function and purpose of each command."""
_LOOKED_AT = ("train", "evaluate", "predict")  # for mistakes, before the function is imported


def main() -> int:
    """Run the command that the command line names, and return its exit code."""
    name, rest = (sys.argv[1], sys.argv[2:]) if len(sys.argv) > 1 else ("", [])
    if name in ("", "-h", "--help"):
        print(usage())
        return DONE if name else MISTAKE
    if name not in COMMANDS:
        known = ", ".join(COMMANDS)
        hint = did_you_mean(name, COMMANDS)
        print(f"error: the command must be one of {known}, got {plain_text(name)}{hint}", file=sys.stderr)
        return MISTAKE
    sys.argv = [sys.argv[0], *rest]
    return run(name)


def run(name: str) -> int:
    """Run a command with the arguments of the process, and return its exit code; mistakes come before imports."""
    if name in _LOOKED_AT:
        import_module("warp_torchrl.commands.first_look").first_look(name, sys.argv[1:])
    register_environments()
    module, _, function = COMMANDS[name][0].partition(":")
    return getattr(import_module(module), function)() or DONE


def usage() -> str:
    """Return what ``--help`` prints."""
    lines = (f"  {name:<16}{purpose}" for name, (_, purpose) in COMMANDS.items())
    return "\n".join(("usage: warp COMMAND ...", "", *lines, "", "warp COMMAND --help tells more of one."))


if __name__ == "__main__":
    sys.exit(main())
