"""Correction of a policy by a scripted person, recorded on the worlds of a training seed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import torch
from tensordict import TensorDictBase
from torchrl.envs.utils import set_exploration_type

from warp_torchrl.demonstrations.recording import Mover, OpenRecording, Recording, step_record
from warp_torchrl.demonstrations.scripted import Person, ScriptedPerson
from warp_torchrl.env import WildfireEnv
from warp_torchrl.evaluation.play import play
from warp_torchrl.heuristics import HEURISTICS, idle_action
from warp_torchrl.models import ACTION, ACTION_MASK, memory_apart
from warp_torchrl.runs.config.components import build_components
from warp_torchrl.runs.config.construction import ENVIRONMENT, ConfigError
from warp_torchrl.runs.config.saved_config import environment_config
from warp_torchrl.runs.config.seeds import SEEDS, WORLDS, first_world_seed
from warp_torchrl.runs.history import trained_steps
from warp_torchrl.runs.policies.named_policy import NamedPolicy, fitted_policy
from warp_torchrl.runs.policies.trained import MODES
from warp_torchrl.validation import check_fields

_ABREAST = 32
"""Episodes that are played at once: a step of few worlds costs what many do."""


@dataclass(frozen=True, kw_only=True)
class Session:
    """Episodes to record.

    Attributes:
        policy: A shipped policy, a run folder or a checkpoint folder; it must have action probabilities, which
            baselines lack.
        out: New folder of the recordings.
        episodes: Number of episodes, on the first worlds of the training seed.
        acts: Number of acts of the person after which no further episode begins; None plays all.
        seed: Training seed of the worlds: no evaluation plays them.
        overrides: Changes to the scenario of the policy's training, in the command line's grammar.

    Raises:
        ValueError: If a value is out of its range.
    """

    policy: str
    out: str
    episodes: int = 32
    acts: int | None = None
    seed: int = 0
    overrides: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self, episodes=(1, WORLDS), acts=(1, 1_000_000_000), seed=(0, SEEDS))


@dataclass(frozen=True)
class Corrected:
    """Result of an episode.

    Attributes:
        recording: What was played with the person.
        saved_alone: Share of the trees that stood at its end without the person; ``recording`` has that with them.
    """

    recording: Recording
    saved_alone: float


class Correction:
    """A policy on a scenario, and a scripted person that corrects it, in many worlds at once.

    Args:
        session: Episodes to record.
        person: Rule of the corrections.

    Raises:
        ConfigError: If the policy is unknown, has no probabilities or does not fit, or an override is wrong.
        CheckpointError: If a run folder holds no sound checkpoint.
    """

    def __init__(self, session: Session, person: Person) -> None:
        found = NamedPolicy(session.policy)
        if found.checkpoint is None:
            raise ConfigError(f"policy must be a trained one, which tells how sure it is, got {session.policy}")
        config = found.config(session.overrides)
        parts = build_components(config, ENVIRONMENT)
        self.session, self.person, self.scenario = session, person, str(config["scenario"])
        self.frames, self.environment = trained_steps(found.checkpoint.history), environment_config(config)
        self.env = WildfireEnv(
            parts["world"],
            observation=parts["observation"],
            reward=parts["reward"],
            n_worlds=min(session.episodes, _ABREAST),
        )
        self.policy = fitted_policy(found.checkpoint, self.env, session.policy)
        self.baseline = HEURISTICS[person.by](self.env)

    def episodes(self) -> Iterator[Corrected]:
        """Play the session's episodes, and yield them in the order of their seeds."""
        count, acts = self.env.batch_size[0], 0
        for start in range(0, self.session.episodes, count):
            for played in self._play(start)[: self.session.episodes - start]:
                yield played
                acts += int(played.recording.by(Mover.PERSON).sum())
                if self.session.acts is not None and acts >= self.session.acts:
                    return

    def _play(self, start: int) -> list[Corrected]:
        """Play an episode in each world with and without the person; ``start`` is the number of the first."""
        env, first = self.env, first_world_seed(self.session.seed) + start
        alone = play(env, self.policy, first, self.policy.mode)["saved"]
        seeds = range(first, first + env.batch_size[0])
        people = [ScriptedPerson(self.person, seed) for seed in seeds]
        open_recording = OpenRecording()
        with (
            torch.random.fork_rng(devices=[]),
            torch.no_grad(),
            set_exploration_type(MODES[self.policy.mode]),
            memory_apart(self.policy),
        ):
            torch.manual_seed(first)
            env.set_seeds(seeds)
            shown = env.reset()
            while not bool(env.shared_state.done.all()):
                row, shown = self._step(shown, people)
                open_recording.rows.append(row)
        steps, saved = open_recording.steps(), env.tree_counts.saved()
        lengths = (~steps["next", "done"][..., 0]).sum(0) + 1  # a world that has ended stays as it is
        return [
            Corrected(self._recording(seed, steps[: int(lengths[at]), at], float(saved[at])), float(alone[at]))
            for at, seed in enumerate(seeds)
        ]

    def _step(self, shown: TensorDictBase, people: Sequence[ScriptedPerson]) -> tuple[TensorDictBase, TensorDictBase]:
        """Play a step in every world; return the step's record, and the next observations."""
        env = self.env
        out = self.policy(shown.copy())
        proposed = out[ACTION]
        chances = self.policy.probabilities(out)
        if chances is None:
            raise ConfigError(f"policy must tell how sure it is, and {self.session.policy} acts by values")
        advice = self.baseline(shown.select(ACTION_MASK))[ACTION]
        possible = env.world.possible_actions(env.shared_state)
        idle = idle_action(possible, env.world.team)
        action, mover = proposed.clone(), torch.full_like(proposed, Mover.POLICY, dtype=torch.uint8)
        for world, person in enumerate(people):
            act = person.drive(chances[world], advice[world], possible[world])
            if person.agent is not None:
                at = (world, person.agent)
                does = act is not None and (bool(possible[at][act]) or act == int(idle[at]))
                action[at] = act if act is not None and does else idle[at]
                mover[at] = Mover.PERSON if does else Mover.WAITING
        after = env.step(shown.set(ACTION, action))["next"]
        return step_record(shown, proposed, mover, after), after

    def _recording(self, seed: int, steps: TensorDictBase, saved: float) -> Recording:
        return Recording(
            steps=steps.clone(),
            environment=self.environment,
            seed=seed,
            events=(),
            policy=self.session.policy,
            frames=self.frames,
            agents=tuple(self.env.agent_names),
            actions=tuple(self.env.action_names),
            saved=saved,
        )
