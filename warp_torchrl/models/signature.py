"""The keys of learning, and what a network must fit: shapes and types, read off an environment's specs."""

from collections.abc import Sequence
from typing import NamedTuple

from torchrl.data import TensorSpec
from torchrl.envs import EnvBase, TransformedEnv

from warp_torchrl.entries import Content, Symmetry

ACTION = ("agents", "action")
AGENCY = ("agents", "agency")
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
RADIO = ("agents", "radio")
REWARD = ("agents", "reward")
ROLE = ("agents", "role")
SENT = ("agents", "sent")
SENT_ORIENTATION = ("agents", "sent_orientation")
STATE = "state"
STATE_ACTION_VALUE = ("agents", "state_action_value")
TEACHER_ACTION = ("agents", "teacher_action")
VALUE = ("agents", "state_value")
Key = tuple[str, ...]
"""Of a tensordict's nested entry."""


def observation_key(name: str, sent: bool = False) -> Key:
    """Return the key of an entry of the observation, or of that which was sent; "" where it is one tensor."""
    whole = SENT if sent else OBSERVATION
    return (*whole, name) if name else whole


def canonical_key(name: str, sent: bool = False) -> Key:
    """Return the key of the same entry in canonical orientation.

    They are not nested: replay memories hold them by these names.
    """
    (team, whole), tail = CANONICAL, f"_{name}" if name else ""
    return (team, f"{whole}_sent{tail}" if sent else whole + tail)


class Entry(NamedTuple):
    """One agent's (or the critic's) entry: shape, name of the type, names along its first dimension, how it turns.

    The names are of a map's channels, or of a vector's numbers; there may be none. What a map's channels can hold is of
    the world that is at hand, and no part of what a network must fit: ``bare`` leaves it out.
    """

    shape: tuple[int, ...]
    dtype: str
    names: tuple[str, ...] = ()  # none where it has none
    symmetry: Symmetry | None = None  # None where it does not say
    content: tuple[Content, ...] = ()  # of each channel; () where it does not say

    def bare(self) -> "Entry":
        """Return the entry without its content."""
        return self._replace(content=())


class Signature(NamedTuple):
    """What a network must fit: the environment's inputs and outputs, without its size."""

    observation: dict[str, Entry]  # by name; "" where the observation is one tensor
    state: Entry
    n_agents: int
    actions: tuple[str, ...]  # by name, in order
    roles: tuple[str, ...]  # by name, in the order of their index
    agencies: tuple[str, ...] = ()  # by name, in the order of their index; () where there is but one
    is_late: bool = False  # whether messages come late, and are made of what was observed when they were sent

    @property
    def n_actions(self) -> int:
        """Return the number of actions."""
        return len(self.actions)

    @property
    def n_roles(self) -> int:
        """Return the number of roles."""
        return len(self.roles)

    def bare(self) -> "Signature":
        """Return the signature without what channels can hold."""
        observation = {name: entry.bare() for name, entry in self.observation.items()}
        return self._replace(observation=observation, state=self.state.bare())

    def observation_keys(self) -> list[tuple[str, ...]]:
        """Return the tensordict keys of the observation's entries."""
        return [observation_key(name) for name in self.observation]


def signature(env: EnvBase) -> Signature:
    """Read the signature off an environment's specs, its names of channels, actions and roles, and how entries turn."""
    specs = env.full_observation_spec_unbatched
    seen = specs[OBSERVATION]
    named = dict(seen.items()) if hasattr(seen, "items") else {"": seen}

    is_ours = not isinstance(env, TransformedEnv)  # a transform may fill what the world leaves empty

    def entry(
        spec: TensorSpec, skip: int, names: tuple[str, ...], symmetry: Symmetry | None, content: tuple[Content, ...]
    ) -> Entry:
        shape = tuple(spec.shape[skip:])  # transforms of TorchRL may stack channels: what does not fit is not told
        return Entry(
            shape,
            str(spec.dtype).removeprefix("torch."),
            names if len(names) == shape[0] else (),
            symmetry if symmetry is not None and symmetry.fits(shape) else None,
            content if is_ours and len(content) == shape[0] else (),
        )

    observation = {
        name: entry(spec, 1, env.channel_names.get(name, ()), env.symmetries.get(name), env.contents.get(name, ()))
        for name, spec in sorted(named.items())
    }
    state = entry(specs["state"], 0, env.state_names, env.state_symmetry, env.state_content)
    agents = specs[ACTION_MASK].shape[0]
    names = env.action_names, env.role_names, env.agency_names
    return Signature(observation, state, agents, *names, is_late=SENT[-1] in specs[SENT[:-1]].keys())


def differing(one: Signature, other: Signature) -> str | None:
    """Return in what two signatures differ for a team of any size: the first entry by name; None where in nothing."""
    one, other = one.bare(), other.bare()
    for name in sorted({*one.observation, *other.observation}):
        if one.observation.get(name) != other.observation.get(name):
            return f"observation {name}".strip()
    if one.is_late != other.is_late:
        return "mechanics.radio.delay"
    return next(
        (name for name in ("state", "actions", "roles", "agencies") if getattr(one, name) != getattr(other, name)), None
    )


def joint(signatures: Sequence[Signature]) -> Signature:
    """Return the signature of a team that plays in several kinds of worlds, which differ in the team's size at most.

    What a channel can hold is told where it is the same in all of them; else it can hold anything.
    """
    first = signatures[0]
    return first._replace(
        observation={name: _joint([each.observation[name] for each in signatures]) for name in first.observation},
        state=_joint([each.state for each in signatures]),
    )


def _joint(entries: Sequence[Entry]) -> Entry:
    if not all(each.content for each in entries):
        return entries[0]._replace(content=())
    told = zip(*(each.content for each in entries), strict=True)
    return entries[0]._replace(content=tuple(each[0] if len(set(each)) == 1 else None for each in told))
