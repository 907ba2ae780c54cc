"""Entry and exit of the commands beside train and evaluate."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from warp_torchrl.commands.failure import DONE, fail
from warp_torchrl.runs.config.grammar import listed_plugins
from warp_torchrl.runs.config.key_help import key_help
from warp_torchrl.runs.config.plugins import load
from warp_torchrl.system.signals import exit_on_signal

PLUGINS = "  plugins=[]\n      Modules of your own, in this folder or installed, plugins=[my_lab]."
"""Lines of ``--help``."""


def command_help(usage: str, *kinds: type, prefix: str = "", more: Sequence[str] = ()) -> str:
    """Return what ``--help`` of a command prints.

    Args:
        usage: How it is called.
        kinds: The dataclasses of its own keys; ``overrides`` holds keys of others.
        prefix: What stands before their names.
        more: Further lines.
    """
    return "\n".join((f"usage: {usage}", "", *(key_help(kind, prefix, ("overrides",)) for kind in kinds), *more))


def tell(text: str) -> None:
    """Print a text; one whose reader has left, as ``head`` does, is no error."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python writes the rest as it ends


def run_program(arguments: Sequence[str] | None, about: str, do: Callable[[list[str]], int | None]) -> int:
    """Run a command, and return its exit code; an error prints one line, and a signal ends the process with one.

    Args:
        arguments: Of the command line; None reads those of the process.
        about: What ``--help`` prints.
        do: Runs the command with these arguments, and returns the exit code; None stands for success.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    if any(each in ("-h", "--help") for each in given):
        tell(about)
        return DONE
    try:
        with exit_on_signal():
            load(listed_plugins(given))
            return do(given) or DONE
    except Exception as error:
        return fail(error, "debug=true" in given)[0]


def flag_arguments(arguments: Sequence[str] | None) -> list[str]:
    """Return the arguments of a command with flags, without the plug-ins that they list, which it imports."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    load(listed_plugins(given))
    return [each for each in given if not each.startswith("plugins=")]


@contextmanager
def one_line_end() -> Iterator[None]:
    """End the process with one line and an exit code where an error or a signal ends this context.

    For commands that read their arguments by ``argparse``.
    """
    try:
        with exit_on_signal():
            yield
    except Exception as error:
        sys.exit(fail(error, debug=False)[0])
