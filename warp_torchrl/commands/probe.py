"""The command probe: linear probes of the messages of a policy."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from warp_torchrl.commands.program import command_help, run_program
from warp_torchrl.evaluation.probe import Reading, probe
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.construction import ConfigError, construct
from warp_torchrl.runs.config.grammar import own_values
from warp_torchrl.runs.config.seeds import FIRST_EVALUATED
from warp_torchrl.runs.policies.named_policy import NamedPolicy, fitted_policy
from warp_torchrl.validation import check_fields

USAGE = "warp probe policy=NAME or FOLDER [episodes=64] [KEY=VALUE ...]"


@dataclass(frozen=True, kw_only=True)
class Probe:
    """Options of a probe.

    Attributes:
        policy: A run folder, or a checkpoint, of a team that talks.
        episodes: Worlds that it plays in; half of them fit the linear maps, the others judge.
        overrides: Of the scenario.

    Raises:
        ValueError: If a value is out of its range.
    """

    policy: str
    episodes: int = 64
    overrides: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self, episodes=(2, 4096))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the linear probes of the policy that the command line names; return the exit code."""
    return run_program(arguments, command_help(USAGE, Probe), lambda given: _probe(read_probe(given)))


def read_probe(arguments: Sequence[str]) -> Probe:
    """Return the options of a command line.

    Raises:
        ConfigError: If a word is no ``key=value``, or a value does not fit.
    """
    values, rest = own_values(arguments, ("policy", "episodes", "debug"), ("policy",))
    return construct(Probe, {**{key: each for key, each in values.items() if key != "debug"}, "overrides": rest}, "")


def _probe(asked: Probe) -> None:
    named = NamedPolicy(asked.policy)
    if named.checkpoint is None:
        raise ConfigError(f"policy must be a trained one, got {asked.policy}")
    config: dict[str, Any] = named.config(asked.overrides)
    made = run_config(config)
    env = made.make_env(asked.episodes, FIRST_EVALUATED)
    policy = fitted_policy(named.checkpoint, env, asked.policy)
    try:
        found = probe(policy, env, FIRST_EVALUATED)
    except ValueError as error:
        raise ConfigError(str(error)) from None
    print(probe_table(found, made.scenario), flush=True)


def probe_table(found: Sequence[Reading], scenario: str) -> str:
    """Return a Markdown table of probes."""
    return "\n".join(
        [
            f"| what a message tells on `{scenario}` (R^2) | trained | weights drawn anew | messages |",
            "|---|---|---|---|",
            *(f"| {each.what} | {each.trained:.2f} | {each.drawn_anew:.2f} | {each.messages} |" for each in found),
        ]
    )
