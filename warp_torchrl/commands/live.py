"""The command live: a team fighting a fire on a local page. It needs the extra ``live``."""

import gc
import importlib.util
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from warp_torchrl.commands.program import command_help, run_program
from warp_torchrl.live.match import Setting
from warp_torchrl.runs.config.construction import ConfigError, construct
from warp_torchrl.runs.config.grammar import own_values
from warp_torchrl.system.foreign_text import plain_text

USAGE = (
    "warp live [policy=NAME or FOLDER] [beside=NAME or FOLDER] [seed=0] [port=8080] "
    "[host=127.0.0.1] [token=TOKEN] [recordings=recordings] [scenario=NAME] [KEY=VALUE ...]"
)
_OURS, _WHERE, _RECORDINGS = ("policy", "beside", "seed"), ("host", "port", "token"), "recordings"
_TEXTS = ("policy", "beside", "host", "token", _RECORDINGS)


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve the page of the command line until it is interrupted, and return the exit code."""
    about = command_help(USAGE, Setting, more=("Other keys are those of warp train, such as team.n_agents.",))
    return run_program(arguments, about, _serve)


def _serve(arguments: Sequence[str]) -> None:
    setting, where, recordings = _read(arguments)
    if importlib.util.find_spec("viser") is None:
        raise ConfigError('the live page needs viser, not installed: pip install "warp_torchrl[live]"')
    from warp_torchrl.live.access import TOKEN_VARIABLE
    from warp_torchrl.live.address import Address
    from warp_torchrl.live.page import Page

    if "token" in where:
        _warn(f"other users of this machine can read a command line: {TOKEN_VARIABLE}=... hides the token from them")
    elif TOKEN_VARIABLE in os.environ:
        where["token"] = os.environ[TOKEN_VARIABLE]
    address = construct(Address, where, "")
    with Page(setting, address, recordings) as page:
        if not page.address.is_local:
            _warn(
                f"host={address.host} opens this page to the network, unencrypted: whoever reads along sees the "
                "token, and whoever has the token can play, save and train"
            )
        print(f"{page.url} shows {plain_text(setting.policy)}; Ctrl-C ends it", flush=True)
        gc.freeze()  # else each collection looks through all of torch, between two messages to a browser
        page.play()


def _read(arguments: Sequence[str]) -> tuple[Setting, dict[str, object], Path]:
    """Return a command line's setting, the values of the address, and the folder of recordings.

    Raises:
        ConfigError: If a word is no ``key=value``, or a value does not fit.
    """
    values, overrides = own_values(arguments, (*_OURS, *_WHERE, _RECORDINGS, "debug"), _TEXTS)
    ours = {key: value for key, value in values.items() if key in _OURS}
    setting = construct(Setting, {**ours, "overrides": overrides}, "")
    named = str(values.get(_RECORDINGS, _RECORDINGS))
    if not named:
        raise ConfigError("recordings must be a folder, got ''")
    recordings = Path(named)
    if recordings.exists() and not recordings.is_dir():
        raise ConfigError(f"recordings must be a folder, got the file {recordings}")
    return setting, {key: value for key, value in values.items() if key in _WHERE}, recordings


def _warn(line: str) -> None:
    print(f"warning: {line}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
