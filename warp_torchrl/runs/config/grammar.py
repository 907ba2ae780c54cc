"""The command line's grammar, with messages that show the right form.

Keys are Hydra's, ``key=value``; its parser reads a value with ``=``, commas or parentheses only in quotes.
"""

import re
from collections.abc import Sequence

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException

from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.validation import did_you_mean

FLAGS = (
    *("--help", "-h", "--hydra-help", "--version", "--cfg", "-c", "--resolve", "--package", "-p", "--run", "-r"),
    *("--multirun", "-m", "--shell-completion", "-sc", "--config-path", "-cp", "--config-name", "-cn"),
    *("--config-dir", "-cd", "--experimental-rerun", "--info", "-i"),
)
"""Hydra's own."""
_CHOICES = {
    **dict.fromkeys(("--cfg", "-c"), ("job", "hydra", "all")),
    **dict.fromkeys(("--info", "-i"), ("all", "config", "defaults", "defaults-tree", "plugins", "searchpath")),
}
_WITH_VALUE = (
    *("--cfg", "-c", "--package", "-p", "--config-path", "-cp", "--config-name", "-cn", "--config-dir", "-cd"),
    "--experimental-rerun",
)


def check_flags(arguments: Sequence[str]) -> None:
    """Check that words with a leading dash are flags of Hydra, and no keys.

    Raises:
        ConfigError: With how keys are given.
    """
    for place, argument in enumerate(arguments):
        flag, equals, value = argument.partition("=")
        if not argument.startswith("-") or flag in FLAGS:
            continue
        beside = arguments[place + 1 : place + 2]
        if not equals and beside and not beside[0].startswith("-") and "=" not in beside[0]:
            value = beside[0]
        key = flag.lstrip("-").replace("-", "_")
        given = f"{key}={value or 'VALUE'}"
        raise ConfigError(f"keys are given as {given}, without dashes; {flag} is no flag{did_you_mean(flag, FLAGS)}")


def flags_first(arguments: Sequence[str]) -> list[str]:
    """Return flags with their values, and then the keys: Hydra's parser takes them in no other order.

    Raises:
        ConfigError: If a flag lacks its value, or has one that it does not take.
    """
    flags: list[str] = []
    keys: list[str] = []
    rest = list(arguments)
    while rest:
        argument = rest.pop(0)
        if not argument.startswith("-"):
            keys.append(argument)
            continue
        flag, equals, value = argument.partition("=")
        choices = _CHOICES.get(flag, ())
        if not equals and rest and (flag in _WITH_VALUE or rest[0] in choices) and not rest[0].startswith("-"):
            value = rest.pop(0)
        if not value and flag in _WITH_VALUE:
            raise ConfigError(f"{flag} needs a value{_one_of(choices)}")
        if value and choices and value not in choices:
            raise ConfigError(f"{flag} needs a value{_one_of(choices)}, got {value}")
        flags.append(f"{flag}={value or 'all'}" if flag in ("--info", "-i") else flag)
        flags += [value] if value and flag not in ("--info", "-i") else []
    return [*flags, *keys]


def _one_of(choices: Sequence[str]) -> str:
    return f" of {', '.join(choices)}" if choices else ""


def check_overrides(overrides: Sequence[str]) -> None:
    """Check that each override is of Hydra's grammar.

    Raises:
        ConfigError: With the first that is not, and how it may have been meant.
    """
    for place, override in enumerate(overrides):
        reason = _refusal(override)
        if reason is None:
            continue
        key, equals, value = override.partition("=")
        if not equals:
            raise ConfigError(_without_equals(overrides, place))
        quoted = "" if value.startswith(("[", "{")) else _quoted(key, value)
        raise ConfigError(
            f"{override} cannot be read: {f'if the value is one text, quote it, {quoted}' if quoted else reason}"
        )


def own_values(
    arguments: Sequence[str], names: Sequence[str], texts: Sequence[str] = ()
) -> tuple[dict[str, object], tuple[str, ...]]:
    """Return the values of a command's own keys, read by Hydra's parser, and the overrides that are left.

    Args:
        arguments: The command line, ``key=value`` each.
        names: The command's own keys.
        texts: Those whose values are texts, whatever they look like; ``null`` is None.

    Raises:
        ConfigError: If a word is no override, or one of the command's keys has several values.
    """
    check_flags(arguments)
    check_overrides(arguments)
    values: dict[str, object] = {}
    rest = []
    for argument in arguments:
        key, _, text = argument.partition("=")
        if key not in names:
            rest.append(argument)
            continue
        override = OverridesParser.create().parse_override(argument)
        if override.is_sweep_override():
            raise ConfigError(several_values(argument))
        value = override.value()
        values[key] = text.strip("'\"") if key in texts and value is not None else value
    return values, tuple(rest)


def listed_plugins(arguments: Sequence[str]) -> tuple[str, ...]:
    """Return the names of plug-ins that a command line lists, ``plugins=[my_lab,yours]``.

    Raises:
        ConfigError: If it is no list.
    """
    listed: tuple[str, ...] = ()
    for argument in (each for each in arguments if each.lstrip("+").startswith("plugins=")):
        check_overrides([argument])
        value = OverridesParser.create().parse_override(argument).value()
        if not isinstance(value, list):
            raise ConfigError(f"plugins must be a list, plugins=[{value}], got {value}")
        listed = tuple(map(str, value))
    return listed


def several_values(override: str) -> str:
    """Return the message for values with commas between them, outside of a sweep."""
    key, _, value = override.partition("=")
    return (
        f"{override} has several values: -m sweeps over them, {key}=[{value}] is a list, {_quoted(key, value)} one text"
    )


def _without_equals(overrides: Sequence[str], place: int) -> str:
    argument = overrides[place]
    before, after = overrides[:place][-1:], overrides[place + 1 :][:1]
    if before and "=" in before[0]:
        key, _, value = before[0].partition("=")
        together = _quoted(key, f"{value} {argument}")
        return f"{argument} has no key: keys are given as key=value; if it belongs to {key}, quote it, {together}"
    value = after[0] if after and "=" not in after[0] else "VALUE"
    return f"{argument} has no value: keys are given as {argument}={value}"


def _refusal(override: str) -> str | None:
    """Return the reason of Hydra's parser to refuse an override; None if it accepts it."""
    try:
        OverridesParser.create().parse_override(override)
    except HydraException as error:
        return " ".join(str(error).partition("See https")[0].split())
    return None


def _quoted(key: str, value: str) -> str:
    """Return an override whose value is one quoted text for a shell; empty if the value is not the fault."""
    escaped = value.replace("'", "\\'")
    override = f"{key}='{escaped}'"
    return "" if _refusal(override) else '"' + re.sub(r'([\\"$`])', r"\\\1", override) + '"'
