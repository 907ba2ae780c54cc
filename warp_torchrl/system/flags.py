"""Argument parser of the commands whose keys may be flags too: an error is one line."""

import argparse
import os
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NoReturn

from warp_torchrl.system.foreign_text import plain_text

MISTAKE = 2
_LONGEST = 4000  # characters of a line


def whole(low: int, high: int) -> Callable[[str], int]:
    """Return a ``type`` for a flag that is a whole number in a range."""

    def number(given: str) -> int:
        if not (given.isascii() and given.isdigit() and len(given) <= len(str(high)) and low <= int(given) <= high):
            raise argparse.ArgumentTypeError(f"must be a whole number in {low}..{high}, got {given}")
        return int(given)

    return number


def file_to_write(given: str) -> Path:
    """Return the path of a file that can be made; a ``type`` for a flag, so that it fails before hours of work.

    Raises:
        argparse.ArgumentTypeError: If it is a folder, or in none.
    """
    path = Path(given)
    if path.is_dir() or not path.parent.is_dir() or not os.access(path.parent, os.W_OK):
        raise argparse.ArgumentTypeError(f"must be a file in a folder that can be written to, got {given}")
    return path


class FlagParser(argparse.ArgumentParser):
    """A parser of keys, ``KEY=VALUE``, which may be given as flags too, ``--KEY VALUE``; an error is one line.

    Lists are ``KEY=[A,B]``, switches ``KEY=true``. Flags cannot be abbreviated.
    """

    def __init__(self, *, prog: str, description: str | None = None) -> None:
        super().__init__(prog=prog, description=description, allow_abbrev=False, formatter_class=_KeyFormatter)

    def parse_known_args(  # type: ignore[override]  # argparse's has overloads by the namespace
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parse arguments whose keys are read as flags."""
        given = list(sys.argv[1:] if args is None else args)
        return super().parse_known_args(self._with_flags(given), namespace)

    def error(self, message: str) -> NoReturn:
        """End the process with the line and the exit code of a mistake."""
        line = re.sub(r"^argument --([\w-]+): ", lambda found: f"{found[1].replace('-', '_')}: ", message)
        self.exit(MISTAKE, f"error: {plain_text(line, _LONGEST)}\n")

    def _with_flags(self, arguments: Sequence[str]) -> list[str]:
        """Return arguments with the keys of this parser as flags, after all others: a list would take what follows.

        Where flags are given with dashes, what has a sign may be a value of theirs, and stays.
        """
        if any(each.startswith("-") for each in arguments):
            return list(arguments)
        others: list[str] = []
        flags: list[str] = []
        for each in arguments:
            key, sign, value = each.partition("=")
            action = self._option_string_actions.get(f"--{key.replace('_', '-')}") if sign else None
            if action is None:
                others.append(each)
            else:
                flags += self._as_flag(key, action, value)
        return [*others, *flags]

    def _as_flag(self, key: str, action: argparse.Action, value: str) -> list[str]:
        flag = action.option_strings[0]
        if action.nargs == 0:
            if value.lower() not in ("true", "false"):
                self.error(f"{key} must be true or false, got {value}")
            return [flag] if value.lower() == "true" else []
        if action.nargs is None:
            return [f"{flag}={value.removeprefix('[').removesuffix(']')}"]
        return [flag, *listed(value)]


def listed(value: str) -> list[str]:
    """Return the entries of ``[A,B]``, which may hold lists of their own; or the one value."""
    if not (value.startswith("[") and value.endswith("]")):
        return [value]
    return [each.strip() for each in re.findall(r"(?:\[[^\]]*\]|[^,\[])+", value[1:-1])]


class _KeyFormatter(argparse.HelpFormatter):
    """Shows flags as keys."""

    def _format_action_invocation(self, action: argparse.Action) -> str:
        if not action.option_strings or action.dest == "help":
            return super()._format_action_invocation(action)
        return f"{action.dest}={self._value(action)}"

    def _format_usage(
        self,
        usage: str | None,
        actions: Iterable[argparse.Action],
        groups: Iterable[argparse._MutuallyExclusiveGroup],
        prefix: str | None,
    ) -> str:
        names = [self._format_args(each, str(each.metavar)) for each in actions if not each.option_strings]
        return f"usage: {' '.join((self._prog, *names))} [KEY=VALUE ...]\n\n"

    def _value(self, action: argparse.Action) -> str:
        if action.nargs == 0:
            return "true"
        one = action.metavar or ("|".join(map(str, action.choices)) if action.choices else "VALUE")
        return f"[{one},...]" if action.nargs else str(one)
