"""Shows a team fighting a fire on a local page: ``python -m warp_torchrl.live``. It needs the extra ``live``."""

import importlib.util
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

from warp_torchrl.commands.failure import DONE, fail
from warp_torchrl.config.construction import ConfigError, construct
from warp_torchrl.config.grammar import check_flags, check_overrides
from warp_torchrl.live.match import Setting

USAGE = (
    "python -m warp_torchrl.live [policy=NAME or FOLDER] [beside=NAME or FOLDER] [seed=0] [port=8080] "
    "[host=127.0.0.1] [recordings=recordings] [scenario=NAME] [KEY=VALUE ...]"
)
_OURS, _WHERE, _RECORDINGS = ("policy", "beside", "seed"), ("host", "port"), "recordings"


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve what the command line asks for until it is interrupted, and return the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if any(each in ("-h", "--help") for each in given):
        print(f"{USAGE}\n\n{Setting.__doc__}\nOther keys are those of train.py, such as team.n_agents.")
        return DONE
    debug = "debug=true" in given
    try:
        _serve([each for each in given if not each.startswith("debug=")])
    except Exception as error:
        return fail(error, debug)[0]
    return DONE


def _serve(arguments: Sequence[str]) -> None:
    setting, where, recordings = _read(arguments)
    if importlib.util.find_spec("viser") is None:
        raise ConfigError('the live page needs viser, not installed: pip install "warp_torchrl[live]"')
    from warp_torchrl.live.page import Address, Page

    address = construct(Address, where, "")
    signal.signal(signal.SIGTERM, _interrupt)
    with Page(setting, address, recordings) as page:
        print(f"{page.url} shows {setting.policy}; Ctrl-C ends it", flush=True)
        try:
            page.play()
        except KeyboardInterrupt:
            print("\nstopped", flush=True)


def _read(arguments: Sequence[str]) -> tuple[Setting, dict[str, object], Path]:
    """Return what the command line asks for: a setting, the address's values, and the folder of recordings.

    Raises:
        ConfigError: If a word is no ``key=value``, or a value does not fit.
    """
    check_flags(arguments)
    check_overrides(arguments)
    pairs = [each.partition("=") for each in arguments]
    known = (*_OURS, *_WHERE, _RECORDINGS)
    own = {key: _value(key, value) for key, _, value in pairs if key in known}
    overrides = tuple("=".join((key, value)) for key, _, value in pairs if key not in known)
    values = {key: value for key, value in own.items() if key in _OURS}
    setting = construct(Setting, {**values, "overrides": overrides}, "")
    recordings = Path(str(own.get(_RECORDINGS, _RECORDINGS)))
    if recordings.exists() and not recordings.is_dir():
        raise ConfigError(f"recordings must be a folder, got the file {recordings}")
    return setting, {key: value for key, value in own.items() if key in _WHERE}, recordings


def _value(key: str, given: str) -> object:
    """Return the value of one of the command's own keys."""
    text = given.strip("'\"")
    if key in ("seed", "port"):
        return int(text) if text.lstrip("-").isdigit() else text
    return None if text == "null" and key == "beside" else text


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
