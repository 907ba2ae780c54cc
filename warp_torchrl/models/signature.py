"""The keys of learning, and what a network must fit: shapes and types, read off an environment's specs."""

from typing import NamedTuple

from torchrl.data import TensorSpec
from torchrl.envs import EnvBase

from warp_torchrl.symmetry import Symmetry

ACTION = ("agents", "action")
ACTION_MASK = ("agents", "action_mask")
ACTION_ONE_HOT = ("agents", "action_one_hot")
ACTION_VALUE = ("agents", "action_value")
CANONICAL = ("agents", "canonical")
CANONICAL_ACTION_ONE_HOT = ("agents", "canonical_action_one_hot")
CANONICAL_STATE = "canonical_state"
CHOSEN_ACTION_VALUE = ("agents", "chosen_action_value")
LOGITS = ("agents", "logits")
LOG_PROB = ("agents", "action_log_prob")
MEMORY = ("agents", "memory")
OBSERVATION = ("agents", "observation")
ORIENTATION = ("agents", "orientation")
REWARD = ("agents", "reward")
ROLE = ("agents", "role")
STATE = "state"
STATE_ACTION_VALUE = ("agents", "state_action_value")
TEACHER_ACTION = ("agents", "teacher_action")
VALUE = ("agents", "state_value")
Key = tuple[str, ...]
"""Of a tensordict's nested entry."""


def observation_key(name: str) -> Key:
    """Return the key of an entry of the observation; "" where it is one tensor."""
    return (*OBSERVATION, name) if name else OBSERVATION


def canonical_key(name: str) -> Key:
    """Return the key of the same entry in canonical orientation.

    They are not nested: TorchRL 0.14 moves no spec that has an entry ``self`` to a device.
    """
    return ("agents", f"canonical_{name}") if name else CANONICAL


class Entry(NamedTuple):
    """One agent's (or the critic's) entry: shape, name of the type, names along its first dimension, how it turns.

    The names are of a map's channels, or of a vector's numbers; there may be none.
    """

    shape: tuple[int, ...]
    dtype: str
    names: tuple[str, ...] = ()  # none where it has none
    symmetry: Symmetry | None = None  # None where it does not say


class Signature(NamedTuple):
    """What a network must fit: the environment's inputs and outputs, without its size."""

    observation: dict[str, Entry]  # by name; "" where the observation is one tensor
    state: Entry
    n_agents: int
    actions: tuple[str, ...]  # by name, in order
    roles: tuple[str, ...]  # by name, in the order of their index

    @property
    def n_actions(self) -> int:
        """Return the number of actions."""
        return len(self.actions)

    @property
    def n_roles(self) -> int:
        """Return the number of roles."""
        return len(self.roles)

    def observation_keys(self) -> list[tuple[str, ...]]:
        """Return the tensordict keys of the observation's entries."""
        return [observation_key(name) for name in self.observation]


def signature(env: EnvBase) -> Signature:
    """Read the signature off an environment's specs, its names of channels, actions and roles, and how entries turn."""
    specs = env.full_observation_spec_unbatched
    seen = specs[OBSERVATION]
    named = dict(seen.items()) if hasattr(seen, "items") else {"": seen}

    def entry(spec: TensorSpec, skip: int, names: tuple[str, ...], symmetry: Symmetry | None) -> Entry:
        shape = tuple(spec.shape[skip:])  # transforms of TorchRL may stack channels: what does not fit is not told
        return Entry(
            shape,
            str(spec.dtype).removeprefix("torch."),
            names if len(names) == shape[0] else (),
            symmetry if symmetry is not None and symmetry.fits(shape) else None,
        )

    observation = {
        name: entry(spec, 1, env.channel_names.get(name, ()), env.symmetries.get(name))
        for name, spec in sorted(named.items())
    }
    state = entry(specs["state"], 0, env.state_names, env.state_symmetry)
    return Signature(observation, state, specs[ACTION_MASK].shape[0], env.action_names, env.role_names)
