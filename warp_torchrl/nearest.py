"""Suggestions for mistyped names."""

from collections.abc import Iterable
from difflib import SequenceMatcher, get_close_matches

_MOST = 2  # names that are offered
_LONGEST = 200  # characters of a name for which others are looked for


def nearest(name: str, known: Iterable[str]) -> list[str]:
    """Return the known names closest to a mistyped one, the likeliest first; none if none is close.

    The last part of a dotted key, ``algorithm.gama``, is first compared within its group, then with equal last parts
    elsewhere; then the whole key with all keys, and at last its last part with all last parts.
    """
    if len(name) > _LONGEST:
        return []
    known = list(dict.fromkeys(known))
    group, _, last = name.lower().rpartition(".")
    in_group = {_last(each): [each] for each in known if each.lower().rpartition(".")[0] == group}
    by_last: dict[str, list[str]] = {}
    for each in sorted(known, key=lambda key: -SequenceMatcher(None, name.lower(), key.lower()).ratio()):
        by_last.setdefault(_last(each), []).append(each)
    whole = {each.lower(): [each] for each in known}
    found = _close(last, in_group) or by_last.get(last) or _close(name.lower(), whole) or _close(last, by_last)
    return found[:_MOST]


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """Return the end of a message, ``: did you mean gamma?``; nothing where no known name is near."""
    found = nearest(str(name), known)
    return f": did you mean {' or '.join(found)}?" if found else ""


def _last(key: str) -> str:
    return key.lower().rpartition(".")[2]


def _close(name: str, named: dict[str, list[str]]) -> list[str]:
    """Return what the name that is closest names."""
    return [each for close in get_close_matches(name, named, n=1, cutoff=0.65) for each in named[close]]
