"""Acts of people in a folder of recordings, as training data for the networks of a run."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from warp_torchrl.collection.cloning import AGENT, Demonstrations
from warp_torchrl.demonstrations.files import MANIFEST, find_recordings, read_recording
from warp_torchrl.demonstrations.recording import Mover, Recording
from warp_torchrl.demonstrations.replay import Replay
from warp_torchrl.env import WildfireEnv
from warp_torchrl.models import ACTION, ACTION_MASK, ROLE, Signature, signature
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.system.checksummed import Unsound


def demonstrations(run_config: RunConfig, env: WildfireEnv) -> Demonstrations | None:
    """Return the acts of people in a run's folder of recordings, on the environment's device; None without one.

    Args:
        run_config: Configuration of the run.
        env: Its environment.

    Raises:
        ConfigError: If the folder holds no act of a person, a recording is not sound, or one does not fit the run.
    """
    if run_config.imitation.demonstrations is None:
        return None
    folder = Path(run_config.imitation.demonstrations)
    wanted, digest = signature(env), sha256()
    agents = env.agent_names if run_config.model.sharing == "none" else None
    known: dict[str, Signature] = {}
    found = []
    try:
        for path in find_recordings(folder):
            recording = read_recording(path)
            digest.update((path / MANIFEST).read_bytes())
            if recording.by(Mover.PERSON).any():
                _check_fits(path, recording, wanted, _signature(recording, known), run_config.model.sharing, agents)
                found.append(acts_of(recording, wanted))
    except (Unsound, ConfigError, OSError) as error:
        raise ConfigError(f"imitation.demonstrations: {error}") from None
    if not sum(map(len, found)):
        raise ConfigError(f"imitation.demonstrations: {folder} holds no act of a person, in none of its recordings")
    canonical = run_config.model.canonical_batch(wanted, state=False)
    return Demonstrations(canonical(torch.cat(found)).to(env.device), digest.hexdigest())


def acts_of(recording: Recording, wanted: Signature) -> TensorDictBase:
    """Return the acts of people that a policy could choose, batch size [n], each as a team of one.

    A person may let a vehicle without the action ``stay`` idle by an act that its mask forbids; those are left out.

    Args:
        recording: Which fits.
        wanted: What the networks fit.
    """
    steps = recording.steps
    could = steps[ACTION_MASK].gather(-1, steps[ACTION][..., None])[..., 0]
    step, agent = (recording.by(Mover.PERSON) & could).nonzero().unbind(-1)

    def chosen(entry: Tensor) -> Tensor:
        return entry[step, agent].unsqueeze(1)

    acts = TensorDict({AGENT: agent.unsqueeze(1)}, batch_size=[len(step)])
    for key in (*wanted.observation_keys(), ACTION_MASK, ACTION, ROLE):
        acts.set(key, chosen(steps[key]))
    return acts


def _signature(recording: Recording, known: dict[str, Signature]) -> Signature:
    """Return the signature of a recording's environment; ``known`` caches it for the next recording."""
    key = json.dumps(asdict(recording.environment), sort_keys=True)
    if key not in known:
        known[key] = signature(Replay(recording).env)
    return known[key]


def _check_fits(
    path: Path, recording: Recording, wanted: Signature, shown: Signature, sharing: str, agents: Sequence[str] | None
) -> None:
    """Check that a recording can be learned from.

    Raises:
        ConfigError: With what differs.
    """
    if recording.actions != wanted.actions:
        raise ConfigError(_differs(path, "actions", recording.actions, wanted.actions))
    if shown.observation.keys() != wanted.observation.keys():
        there, here = (tuple(name or "a single tensor" for name in each.observation) for each in (shown, wanted))
        raise ConfigError(_differs(path, "observation entries", there, here))
    for name, entry in wanted.observation.items():
        for what in ("shape", "dtype", "names"):
            recorded, own = getattr(shown.observation[name], what), getattr(entry, what)
            if recorded != own:
                label = f"observation {name}'s {what}" if name else f"observation's {what}"
                raise ConfigError(_differs(path, label, recorded, own))
    if sharing == "role" and shown.roles != wanted.roles:
        raise ConfigError(_differs(path, "roles", shown.roles, wanted.roles))
    if agents is not None and recording.agents != tuple(agents):
        raise ConfigError(
            _differs(path, "agents", recording.agents, tuple(agents))
            + ", and model.sharing=none has a network for each"
        )
    team = (len(recording.steps), len(recording.agents))
    entries = [
        (key, entry.shape, entry.dtype) for key, entry in zip(wanted.observation_keys(), shown.observation.values())
    ]
    for key, shape, dtype in (*entries, (ROLE, (), "int64")):
        held = recording.steps.get(key, None)
        if not isinstance(held, Tensor) or held.shape != (*team, *shape) or str(held.dtype) != f"torch.{dtype}":
            raise ConfigError(f"{path} does not hold the {' '.join(key[1:])} that its own configuration has")


def _differs(path: Path, what: str, there: object, here: object) -> str:
    """Return the line that names the difference between a recording and a run."""
    if not (isinstance(there, tuple) and isinstance(here, tuple) and isinstance((*there, "")[0], str)):
        return f"{path} was recorded with the {what} {there}, and the run has {here}"
    more, less = ([each for each in one if each not in other] for one, other in ((there, here), (here, there)))
    parts = [f"{label} {', '.join(names)}" for label, names in (("with", more), ("without", less)) if names]
    return f"{path} was recorded with other {what} than the run has: {' and '.join(parts) or 'in another order'}"
