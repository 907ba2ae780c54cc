"""Models: which networks an algorithm's actors and critics are, and what they read and write."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from tensordict.nn import TensorDictModule
from torch import nn

from warp_torchrl.models.facing import FacingFire, StateFacingFire
from warp_torchrl.models.memory import BEGINS, RecurrentActor, RecurrentNetwork
from warp_torchrl.models.networks import (
    AgentNetworks,
    Central,
    ConvolutionalEncoder,
    LinearEncoder,
    Network,
    RoleNetworks,
)
from warp_torchrl.models.signature import (
    ACTION_ONE_HOT,
    ACTION_VALUE,
    FRAME,
    LOGITS,
    MEMORY,
    ROLE,
    STATE,
    STATE_ACTION_VALUE,
    VALUE,
    Entry,
    Signature,
)
from warp_torchrl.observation.channels import DEFAULT, FIRE
from warp_torchrl.observation.frame import can_be_held
from warp_torchrl.validation import check_fields

_ACTIVATIONS = {"tanh": nn.Tanh, "relu": nn.ReLU}


@dataclass(frozen=True, kw_only=True)
class Mlp:
    """Multilayer perceptrons over flattened observations.

    Attributes:
        sharing: ``team`` gives all agents one network, ``role`` one to each role (chosen by the role index, so that
            it fits any team), ``none`` one to each agent (which fits teams of the same size only).
        actor_hidden: Sizes of the hidden layers of actors and of the action values that act.
        critic_hidden: Sizes of the critics'.
        activation: ``tanh`` or ``relu``.
        facing: ``fire``, each network holds the map so that the fire that an agent sees lies between its east and its
            south-east, see ``FacingFire``: what it learns of one case it knows of all eight. ``north``, as it is given.
        memory: Units of the recurrent layer by which actors remember what they saw since their episode began, see
            ``RecurrentNetwork``, a multiple of 8; 0, they act on what they see now. On-policy algorithms learn it.
        dtype: ``bfloat16`` computes the layers in half precision (weights stay float32), several times faster on
            processors that have it and several times slower on those that have not; ``auto`` takes it where they do.

    Raises:
        ValueError: If a size is out of range or there is no hidden layer, or, when networks are made, if they should
            face a fire in observations that are of no preset, or remember where those have no clock.
    """

    sharing: Literal["team", "role", "none"] = "team"
    actor_hidden: tuple[int, ...] = (128, 128)
    critic_hidden: tuple[int, ...] = (128, 128)
    activation: Literal["tanh", "relu"] = "tanh"
    facing: Literal["north", "fire"] = "fire"
    memory: int = 0
    dtype: Literal["auto", "float32", "bfloat16"] = "auto"

    def __post_init__(self) -> None:
        check_fields(self, memory=(0, 8192))
        for name in ("actor_hidden", "critic_hidden"):
            check_sizes(name, getattr(self, name))
        if self.memory % 8:
            raise ValueError(f"memory must be a multiple of 8, got {self.memory}")

    def actor(self, signature: Signature) -> TensorDictModule:
        """Return the module that writes logits [..., A, actions] from each agent's own observation, and memory."""
        if self.memory and "self" not in signature.observation:
            raise ValueError(f"model.memory must be 0 where observations have no clock, got {self.memory}")
        return self._of_agents(signature, self.actor_hidden, signature.n_actions, 0.01, LOGITS, memory=self.memory)

    def action_value(self, signature: Signature) -> TensorDictModule:
        """Return the module that writes each action's value [..., A, actions] from each agent's own observation."""
        return self._of_agents(signature, self.actor_hidden, signature.n_actions, 0.01, ACTION_VALUE)

    def critic(self, signature: Signature, central: bool) -> TensorDictModule:
        """Return the module that writes values [..., A, 1] from each agent's observation, and the state if central.

        A central critic that has the state and each agent's picture does without its view.
        """
        return self._of_agents(signature, self.critic_hidden, 1, 1.0, VALUE, central=central)

    def action_critic(self, signature: Signature, central: bool) -> TensorDictModule:
        """Return the module that writes values [..., A, 1] of actions given as one-hot vectors [..., A, actions].

        It reads each agent's observation and own action, and the state and the whole team's actions if central.
        """
        return self._of_agents(signature, self.critic_hidden, 1, 1.0, STATE_ACTION_VALUE, central=central, judges=True)

    def of_state(self, network: nn.Module) -> nn.Module:
        """Return a network whose last input is the state as one that is given the state as these networks hold it."""
        return StateFacingFire(network) if self.facing == "fire" else network

    def _of_agents(
        self,
        signature: Signature,
        hidden: tuple[int, ...],
        out: int,
        head_gain: float,
        key: tuple[str, ...],
        *,
        central: bool = False,
        judges: bool = False,
        memory: int = 0,
    ) -> TensorDictModule | RecurrentActor:
        """Return the module that writes [..., A, out] from each agent's entries.

        Args:
            signature: Shapes of what is read.
            hidden: Sizes of the hidden layers.
            out: Size of the output.
            head_gain: Gain of the last layer's initial weights.
            key: Where it writes.
            central: Whether it reads the state too.
            judges: Whether it reads the action that was chosen too, and that of the team where it is central.
            memory: Units that it remembers by.
        """
        entries = list(signature.observation.values())
        keys: list[str | tuple[str, ...]] = list(signature.observation_keys())
        if judges:
            entries.append(Entry((signature.n_actions,), "float32"))
            keys.append(ACTION_ONE_HOT)
        action = len(keys) - 1 if judges else None
        unread = _unread(list(signature.observation)) if central and not judges else None
        if unread is not None:
            del entries[unread]
        if central:
            joint = [Entry((signature.n_agents * signature.n_actions,), "float32")] if judges else []
            entries = [signature.state, *joint, *entries]
        network = self._shared(signature, lambda: self._network(entries, hidden, out, head_gain, memory))
        if memory:
            keys += [BEGINS, FRAME, MEMORY]
        if self.sharing == "role":
            keys.append(ROLE)
        if central:
            network, keys = Central(network, len(signature.state.shape), action, unread), [STATE, *keys]
        if self.facing == "fire":
            shapes = {name: entry.shape for name, entry in signature.observation.items()}
            if not can_be_held(shapes, signature.observation["self"].names if "self" in shapes else ()):
                raise ValueError("model.facing must be north where observations are of no preset, got fire")
            actions = out if key in (LOGITS, ACTION_VALUE) else 0
            network = FacingFire(network, keys, actions, _fire_channel(signature))
        if memory:
            return RecurrentActor(network, [key for key in keys if key not in (BEGINS, FRAME, MEMORY)], out, memory)
        return TensorDictModule(network, in_keys=keys, out_keys=[key])

    def _shared(self, signature: Signature, make: Callable[[], Network | RecurrentNetwork]) -> nn.Module:
        """Return as many networks as the team has."""
        if self.sharing == "team":
            return make()
        if self.sharing == "role":
            return RoleNetworks([make() for _ in range(signature.n_roles)])
        networks = [make() for _ in range(signature.n_agents)]
        return AgentNetworks(networks, networks[0].entries)

    def _network(
        self, entries: list[Entry], hidden: tuple[int, ...], out: int, head_gain: float, memory: int
    ) -> Network | RecurrentNetwork:
        encoder, activation = self._encoder(entries, hidden[0]), _ACTIVATIONS[self.activation]
        network = Network(encoder, tuple(hidden), out, activation, head_gain, self.dtype)
        return RecurrentNetwork(network, hidden[0], memory) if memory else network

    def _encoder(self, entries: list[Entry], size: int) -> LinearEncoder | ConvolutionalEncoder:
        return LinearEncoder(entries, size)


@dataclass(frozen=True, kw_only=True)
class Cnn(Mlp):
    """Convolutions over what is a picture (the view, the map pooled to 8 x 8, the state), then as ``Mlp``.

    Attributes:
        channels: Output channels of each convolution.
        kernel_size: Of each, odd.

    Raises:
        ValueError: If a size is out of range or the kernel is even.
    """

    activation: Literal["tanh", "relu"] = "relu"
    dtype: Literal["auto", "float32", "bfloat16"] = "float32"
    channels: tuple[int, ...] = (16, 16)
    kernel_size: int = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        check_sizes("channels", self.channels)
        if not (1 <= self.kernel_size <= 15 and self.kernel_size % 2):
            raise ValueError(f"kernel_size must be odd and in 1..15, got {self.kernel_size}")

    def _encoder(self, entries: list[Entry], size: int) -> ConvolutionalEncoder:
        return ConvolutionalEncoder(
            entries, size, tuple(self.channels), self.kernel_size, _ACTIVATIONS[self.activation]
        )


def _fire_channel(signature: Signature) -> int:
    """Return which channel of a view tells where fire is, whatever the number where there is no view.

    Raises:
        ValueError: If the view has no such channel.
    """
    if "view" not in signature.observation:
        return 0
    view = signature.observation["view"]
    channels = view.names or DEFAULT
    if len(channels) != view.shape[0]:
        raise ValueError("model.facing must be north where observations are of no preset, got fire")
    if FIRE not in channels:
        raise ValueError(f"model.facing must be north where observation.channels lack {FIRE}, got fire")
    return channels.index(FIRE)


def _unread(names: list[str]) -> int | None:
    """Return the place of the entry that a central critic of a state does without, a view beside a picture."""
    return names.index("view") if {"view", "picture"} <= set(names) else None


def check_sizes(name: str, sizes: tuple[int, ...]) -> None:
    """Check the sizes of layers.

    Raises:
        ValueError: If one is not in 1..8192 or there is none.
    """
    if not sizes or not all(1 <= size <= 8192 for size in sizes):
        raise ValueError(f"{name} must be a list of sizes in 1..8192, got {list(sizes)}")
