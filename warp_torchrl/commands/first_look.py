"""A first look at a command line, for mistakes that show at once: torch and TorchRL take seconds to import.

It composes and checks as the command itself does, by excerpts of modules: see ``warp_torchrl.system.excerpt``. What
they do not reach, as tables that plug-ins fill, is left to the command, which checks everything again.
"""

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from importlib.metadata import entry_points
from typing import Any, NoReturn

from warp_torchrl.runs.config.compose import check_choices, composed, without_libraries
from warp_torchrl.runs.config.construction import COMPONENTS, ConfigError, chosen, component, construct
from warp_torchrl.runs.config.defaults import UNKNOWN
from warp_torchrl.runs.config.files import PREDICTION
from warp_torchrl.runs.config.grammar import check_overrides
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.plugins import ENTRY_POINTS
from warp_torchrl.runs.config.prediction import compose_prediction
from warp_torchrl.system.excerpt import OutOfReachError, excerpt, is_stand_in
from warp_torchrl.system.exit_codes import MISTAKE
from warp_torchrl.system.foreign_text import error_line

_LEFT_TO_THE_COMMAND = ("plugins=", "+plugins=", "debug=", "hydra.", "+hydra.")
_PARTS = {
    "": ("warp_torchrl.world.episode_rules.EpisodeRules", "warp_torchrl.runs.config.run_numbers.RunNumbers"),
    "checkpoint": ("warp_torchrl.runs.config.options.CheckpointConfig",),
    "evaluation": ("warp_torchrl.runs.config.options.EvaluationConfig",),
    "imitation": ("warp_torchrl.collection.imitation.Imitation",),
}
"""Classes of a run's values by section, beside its components."""


def first_look(name: str, arguments: Sequence[str]) -> None:
    """Print a mistake of a command line, and end the process with an exit code, if one is seen without torch.

    Args:
        name: ``train``, ``evaluate`` or ``predict``.
        arguments: Of the command line.
    """
    is_simple = all("=" in each and not each.startswith(("-", *_LEFT_TO_THE_COMMAND)) for each in arguments)
    if not arguments or not is_simple or "TORCHELASTIC_RUN_ID" in os.environ or entry_points(group=ENTRY_POINTS):
        return
    try:
        with without_libraries():
            _LOOKS[name](arguments)
    except ConfigError as error:
        print(error_line(str(error)), file=sys.stderr, flush=True)
        sys.exit(MISTAKE)
    except OutOfReachError:
        return


def _look_at_run(name: str, check: str, arguments: Sequence[str]) -> None:
    check_overrides(arguments)
    values = plain(composed(name, arguments))
    check_choices(arguments)
    module, _, function = check.rpartition(".")
    excerpt(module, function)(values, arguments, _check_run)


def _look_at_prediction(arguments: Sequence[str]) -> None:
    values = compose_prediction(arguments)
    kind = component(PREDICTION)
    if kind is not None:
        construct(kind, chosen(kind, values), "")


_LOOKS: Mapping[str, Callable[[Sequence[str]], None]] = {
    "train": lambda given: _look_at_run("train", "warp_torchrl.training.checks.check_training", given),
    "evaluate": lambda given: _look_at_run("evaluate", "warp_torchrl.evaluation.checks.check_evaluation", given),
    "predict": _look_at_prediction,
}


def _check_run(values: Mapping[str, Any]) -> NoReturn:
    """Check the keys of a run and each of its parts alone.

    Raises:
        ConfigError: With key, value and rule.
        OutOfReachError: If there is no mistake: what holds between the parts is left to the command.
    """
    excerpt("warp_torchrl.runs.config.building", "check_keys")(values)
    for section in dict.fromkeys(("model", *COMPONENTS)):  # in the order of ``build_components``
        own = {key: value for key, value in values[section].items() if key != "_target_"}
        _check_part(values[section]["_target_"], own, section)
    for section, targets in _PARTS.items():
        for target in targets:
            _check_part(target, values[section] if section else values, section)
    raise OutOfReachError("what holds between parts")


def _check_part(target: str, values: Mapping[str, Any], section: str) -> None:
    try:
        kind = component(target)
        if kind is None:
            return
        own = chosen(kind, values) if not section else values
        own = {key: value for key, value in own.items() if value != UNKNOWN}
        if any(is_stand_in(each.default) for each in fields(kind) if each.name not in own):
            return
        construct(kind, own, section)
    except OutOfReachError:
        return
