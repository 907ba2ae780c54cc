"""A match: one fire, played step by step by one policy or two, and beside them the same fire without a team.

All sides have the same seed. Every draw of a world is a function of seed, episode, tick and cell, so the fires differ
by what the teams do, and by nothing else.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from torch import Tensor

from warp_torchrl.demonstrations.events import at_cell
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.live.crew import Question, Refused
from warp_torchrl.live.player import Player, player_of
from warp_torchrl.live.side import Side
from warp_torchrl.runs.config.components import build_components
from warp_torchrl.runs.config.construction import ENVIRONMENT
from warp_torchrl.runs.config.saved_config import environment_config
from warp_torchrl.runs.config.seeds import FIRST_EVALUATED
from warp_torchrl.runs.policies.named_policy import NamedPolicy
from warp_torchrl.validation import check_fields
from warp_torchrl.world.ignition.intervention import can_be_lit
from warp_torchrl.world.state.cells import is_tree
from warp_torchrl.world.world import World

SEED_RANGE = (0, 2**62 - 1)
"""Of fires, from and to."""


@dataclass(frozen=True, kw_only=True)
class Setting:
    """What a match is of.

    Attributes:
        policy: A baseline, a shipped policy, a run folder or a checkpoint folder.
        beside: Another one that plays the same fire; None plays one side.
        seed: Of the fire; the default is the first that evaluations have.
        overrides: Of the scenario, in the command line's grammar; a trained policy plays without any in the scenario of
            its training.

    Raises:
        ValueError: If a value is out of its range.
    """

    policy: str = "generalist"
    beside: str | None = None
    seed: int = FIRST_EVALUATED
    overrides: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self, seed=SEED_RANGE)


class Match:
    """A fire and the teams that fight it.

    Args:
        setting: Scenario, policies and seed.

    Raises:
        ConfigError: If a policy is unknown or does not fit, or an override is wrong.
        CheckpointError: If a run folder holds no sound checkpoint.
    """

    def __init__(self, setting: Setting) -> None:
        found = [NamedPolicy(name) for name in (setting.policy, setting.beside) if name is not None]
        config = found[0].config(setting.overrides)
        parts = build_components(config, ENVIRONMENT)
        sides = []
        for each in found:
            # Each sees what it was trained to see, in the first one's world.
            values = {**config, "observation": each.config(setting.overrides)["observation"]}
            seen = build_components(values, ENVIRONMENT)
            env = WildfireEnv(
                parts["world"], observation=seen["observation"], reward=parts["reward"], seed=setting.seed
            )
            env.reset()
            sides.append(Side(env, player_of(each, env, setting.seed), environment_config(values)))
        self._set(setting, config, parts, sides)

    def _set(
        self, setting: Setting, config: Mapping[str, Any], parts: Mapping[str, Any], sides: Sequence[Side]
    ) -> None:
        """Set the sides, and the fire without a team beside them, at the start of the episode.

        Args:
            setting: Scenario, policies and seed.
            config: The composed configuration, as plain values.
            parts: Components built from the configuration.
            sides: The teams.
        """
        self.setting, self.sides = setting, sides
        self.scenario: str = config["scenario"]
        self.world: World = parts["world"]
        alone = WildfireEnv(self.world, observation=parts["observation"], reward=parts["reward"], seed=setting.seed)
        nobody = Player("without a team", HEURISTICS["noop"](alone), "sampled", setting.seed)
        self.alone = Side(alone, nobody, environment_config(config))
        self.restart()

    @property
    def everywhere(self) -> Sequence[Side]:
        """Return the sides, and the fire without a team."""
        return [*self.sides, self.alone]

    @property
    def ended(self) -> bool:
        """Return whether the episode is over on all sides, and without a team."""
        return all(side.ended for side in self.everywhere)

    def restart(self, seed: int | None = None) -> None:
        """Restart the episode, or start that of another seed.

        Raises:
            ValueError: If the seed is out of range.
        """
        if seed is not None:
            self.setting = replace(self.setting, seed=seed)
        for side in self.everywhere:
            side.restart(self.setting.seed)

    def questions(self) -> list[Question]:
        """Return the acts of the first side that wait for a person's word before the next step."""
        return self.sides[0].questions()

    def step(self) -> list[str]:
        """Advance all sides by one step, unless a question is open.

        Returns:
            A line for each act of a person that was refused.
        """
        if self.questions() or self.ended:
            return []
        told = []
        for side in self.everywhere:
            side.questions()
            told += side.step()
        return told

    def follow(self) -> list[str]:
        """Load the newest weights of runs that are still training; return a line for each change."""
        told = (side.player.follow(side.env) for side in self.sides)
        return [line for line in told if line is not None]

    # What people do to the world

    def blow(self, speed: float, direction: float) -> None:
        """Hold one wind over the whole map, on all sides, until the next start.

        Args:
            speed: In 0..60 [m/s].
            direction: Where the air goes, degrees from east, counter-clockwise.

        Raises:
            ValueError: If the speed is out of its range.
        """
        for side in self.everywhere:
            side.intervene("blow", speed, direction)

    def ignite(self, row: int, column: int) -> None:
        """Light a cell, on every side where it can burn.

        Raises:
            Refused: If it can burn on none, or the time is up.
        """
        self._check_time()
        here = self._cell(row, column)
        where = [bool((can_be_lit(side.state, self.world.fire) & here).any()) for side in self.everywhere]
        if not any(where):
            raise Refused(f"cell {row}, {column} holds no dry tree that can burn")
        for side in self.everywhere:
            side.intervene("ignite", row, column)

    def clear(self, row: int, column: int) -> None:
        """Cut a firebreak into a cell, on every side where it holds a tree that does not burn.

        Raises:
            Refused: If none holds one, or the time is up.
        """
        self._check_time()
        here = self._cell(row, column)
        if not any(bool((is_tree(side.state.cells) & here).any()) for side in self.everywhere):
            raise Refused(f"cell {row}, {column} holds no tree to clear")
        for side in self.everywhere:
            side.intervene("clear", row, column)

    def _check_time(self) -> None:
        if bool(self.sides[0].state.truncated[0]):
            raise Refused("the episode is over: start it anew")

    def check_cell(self, row: int, column: int) -> None:
        """Check that a cell is on the map.

        Raises:
            Refused: If it is not.
        """
        self._cell(row, column)

    def _cell(self, row: int, column: int) -> Tensor:
        """Return where a cell is, bool [1, H, W].

        Raises:
            Refused: If it is not on the map.
        """
        try:
            return at_cell(self.alone.env, row, column)
        except ValueError as error:
            raise Refused(str(error)) from None
