"""What the commands beside train and evaluate begin and end with."""

import sys
from collections.abc import Callable, Sequence

from warp_torchrl.commands.failure import DONE, fail


def run_program(arguments: Sequence[str] | None, about: str, do: Callable[[list[str]], int | None]) -> int:
    """Run a command, and return its exit code; an error is told in one line.

    Args:
        arguments: Of the command line; None takes the program's own.
        about: What ``--help`` prints.
        do: Does what the arguments ask for, and returns the exit code; None stands for success.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    if any(each in ("-h", "--help") for each in given):
        print(about)
        return DONE
    try:
        return do(given) or DONE
    except Exception as error:
        return fail(error, "debug=true" in given)[0]
