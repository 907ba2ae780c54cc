"""Recordings in which people drove every vehicle."""

import torch

from warp_torchrl.demonstrations.recording import Mover, OpenRecording, Recording
from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.models import ACTION
from warp_torchrl.runs.config.components import build_components
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ENVIRONMENT
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import environment_config

SMALL = ("landscape.size=12", "horizon=20")


def played(*overrides, mover=Mover.PERSON, seed=7, steps=16, by="greedy"):
    """An episode that someone played as a baseline plays it."""
    config = plain(compose_config("train", [*SMALL, *overrides]))
    parts = build_components(config, ENVIRONMENT)
    env = WildfireEnv(parts["world"], observation=parts["observation"], reward=parts["reward"], seed=seed)
    baseline, open_recording, shown = HEURISTICS[by](env), OpenRecording(), env.reset()
    while len(open_recording.rows) < steps and not bool(env.world_state.done[0]):
        shown = baseline(shown)
        proposed = torch.zeros_like(shown[ACTION][0])
        after = env.step(shown)["next"]
        open_recording.add(shown, proposed, [mover] * env.n_agents, after)
        shown = after
    return Recording(
        steps=open_recording.steps(),
        environment=environment_config(config),
        seed=seed,
        events=(),
        policy="nobody",
        frames=None,
        agents=tuple(env.agent_names),
        actions=tuple(env.action_names),
    )
