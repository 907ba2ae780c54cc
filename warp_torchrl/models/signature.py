"""The keys of learning, and what a network must fit: shapes and types, read off an environment's specs."""

from typing import NamedTuple

from torchrl.data import TensorSpec
from torchrl.envs import EnvBase

ACTION = ("agents", "action")
ACTION_MASK = ("agents", "action_mask")
ACTION_ONE_HOT = ("agents", "action_one_hot")
ACTION_VALUE = ("agents", "action_value")
CHOSEN_ACTION_VALUE = ("agents", "chosen_action_value")
FRAME = ("agents", "frame")
LOGITS = ("agents", "logits")
LOG_PROB = ("agents", "action_log_prob")
MEMORY = ("agents", "memory")
OBSERVATION = ("agents", "observation")
REWARD = ("agents", "reward")
ROLE = ("agents", "role")
STATE = "state"
STATE_ACTION_VALUE = ("agents", "state_action_value")
TEACHER_ACTION = ("agents", "teacher_action")
VALUE = ("agents", "state_value")


class Entry(NamedTuple):
    """Shape of one agent's (or the critic's) entry, its type's name, and the names along its first dimension.

    Those are of a map's channels, or of a vector's numbers; there may be none.
    """

    shape: tuple[int, ...]
    dtype: str
    names: tuple[str, ...] = ()


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
        return [(*OBSERVATION, name) if name else OBSERVATION for name in self.observation]


def signature(env: EnvBase) -> Signature:
    """Read the signature off an environment's specs, and its names of channels, actions and roles."""
    specs = env.full_observation_spec_unbatched
    seen = specs[OBSERVATION]
    named = dict(seen.items()) if hasattr(seen, "items") else {"": seen}

    def entry(spec: TensorSpec, skip: int, names: tuple[str, ...] = ()) -> Entry:
        shape = tuple(spec.shape[skip:])
        fit = names if len(names) == shape[0] else ()  # transforms of TorchRL may stack channels
        return Entry(shape, str(spec.dtype).removeprefix("torch."), fit)

    observation = {name: entry(spec, 1, env.channel_names.get(name, ())) for name, spec in sorted(named.items())}
    state = entry(specs["state"], 0, env.state_names)
    return Signature(observation, state, specs[ACTION_MASK].shape[0], env.action_names, env.role_names)
