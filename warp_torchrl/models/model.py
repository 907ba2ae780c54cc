"""Models: the networks of actors and critics, and the keys that they read and write."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Literal

from tensordict.nn import TensorDictModule, TensorDictModuleBase
from torch import nn

from warp_torchrl.models.canonical import CanonicalBatch
from warp_torchrl.models.inputs import Inputs
from warp_torchrl.models.memory import RecurrentActor, RecurrentNetwork
from warp_torchrl.models.messages import TalkingNetwork
from warp_torchrl.models.networks import (
    AgentNetworks,
    Central,
    ConvolutionalEncoder,
    IndexedNetworks,
    LinearEncoder,
    Network,
)
from warp_torchrl.models.signature import (
    ACTION_VALUE,
    AGENCY,
    CANONICAL_STATE,
    LOGITS,
    RADIO,
    ROLE,
    STATE,
    STATE_ACTION_VALUE,
    VALUE,
    Entry,
    Key,
    Signature,
)
from warp_torchrl.validation import check_fields

ACTIVATIONS = {"tanh": nn.Tanh, "relu": nn.ReLU}
"""Functions between layers, by name."""
_INDEX = {"role": ROLE, "agency": AGENCY}
"""Where the index is by which an agent's network is chosen."""


@dataclass(frozen=True, kw_only=True)
class Mlp:
    """Multilayer perceptrons over flattened observations.

    Attributes:
        sharing: ``team`` gives all agents one network, ``role`` one to each role (chosen by the role index, so that it
            fits any team), ``agency`` one to each agency, for the vehicles that serve it, ``none`` one to each agent
            (which fits teams of the same size only).
        actor_hidden: Sizes of the hidden layers of actors, and of action values that act.
        critic_hidden: Sizes of the critics'.
        activation: ``tanh`` or ``relu``.
        symmetry: ``canonical``: networks read an agent's observation turned and mirrored so that the fire lies between
            its east and its south-east, see ``Canonicalise``; one learned case then covers all eight symmetries of the
            square. ``none``: north up.
        memory: Units of the recurrent layer by which actors remember since their episode began, see
            ``RecurrentNetwork``, a multiple of 8; 0: no memory. Only on-policy algorithms train it.
        messages: ``graph``: actors send each other learned messages, see ``TalkingNetwork``, within
            ``mechanics.radio.range``; only on-policy algorithms train it. ``map``: they share their maps of the fire, a
            rule of the world; ``both``, or ``none``.
        message_size: Numbers of a message, a multiple of 8.
        message_rounds: Messages that each agent sends in a step, each after receiving the ones before; 1 where messages
            arrive late (``mechanics.radio.delay``).
        trust: Trust of agents in their adviser, ``observation.advice``: added to the logit of the advised action, times
            log2 of the team's size, see ``Trust``.
        dtype: ``bfloat16`` computes the layers in half precision (weights stay float32), several times faster on
            processors with bfloat16 and several times slower on others; ``auto`` uses it on processors with it.

    Raises:
        ValueError: If a size is out of range or there is no hidden layer, if agents that talk have a memory or do not
            share one network, or, when networks are made, if canonical observations do not declare their symmetry,
            a memory lacks a clock, trust lacks advice, or late messages have several rounds.
    """

    sharing: Literal["team", "role", "agency", "none"] = "team"
    actor_hidden: tuple[int, ...] = (128, 128)
    critic_hidden: tuple[int, ...] = (128, 128)
    activation: Literal["tanh", "relu"] = "tanh"
    symmetry: Literal["canonical", "none"] = "canonical"
    memory: int = 0
    messages: Literal["none", "map", "graph", "both"] = "none"
    message_size: int = 32
    message_rounds: int = 1
    trust: float = 0.0
    dtype: Literal["auto", "float32", "bfloat16"] = "auto"

    def __post_init__(self) -> None:
        check_fields(self, memory=(0, 8192), message_size=(8, 8192), message_rounds=(1, 16), trust=(0.0, 100.0))
        for name in ("actor_hidden", "critic_hidden"):
            check_sizes(name, getattr(self, name))
        if self.memory % 8:
            raise ValueError(f"memory must be a multiple of 8, got {self.memory}")
        if self.message_size % 8:
            raise ValueError(f"message_size must be a multiple of 8, got {self.message_size}")
        if self.talks and self.memory:
            raise ValueError(f"memory must be 0 where agents talk, messages={self.messages}, got {self.memory}")
        if self.talks and self.sharing != "team":
            raise ValueError(f"sharing must be team where agents talk, messages={self.messages}, got {self.sharing}")

    @property
    def talks(self) -> bool:
        """Return whether actors exchange learned messages."""
        return self.messages in ("graph", "both")

    def actor(self, signature: Signature) -> TensorDictModuleBase:
        """Return the module that writes logits [..., A, actions] from each agent's observation and memory."""
        n_actions, talks = signature.n_actions, self.talks
        return self._of_agents(signature, self.actor_hidden, n_actions, 0.01, LOGITS, memory=self.memory, talks=talks)

    def action_value(self, signature: Signature) -> TensorDictModuleBase:
        """Return the module that writes each action's value [..., A, actions] from each agent's observation."""
        return self._of_agents(signature, self.actor_hidden, signature.n_actions, 0.01, ACTION_VALUE)

    def critic(self, signature: Signature, central: bool) -> TensorDictModuleBase:
        """Return the module that writes values [..., A, 1] from each agent's observation, and the state if central.

        A central critic that has the state and each agent's picture does without its view.
        """
        return self._of_agents(signature, self.critic_hidden, 1, 1.0, VALUE, central=central)

    def action_critic(self, signature: Signature, central: bool) -> TensorDictModuleBase:
        """Return the module that writes values [..., A, 1] of actions given as one-hot vectors [..., A, actions].

        It reads each agent's observation and own action, and the state and the whole team's actions if central.
        """
        return self._of_agents(signature, self.critic_hidden, 1, 1.0, STATE_ACTION_VALUE, central=central, judges=True)

    @property
    def state_key(self) -> str:
        """Return the key of the state that these networks read."""
        return CANONICAL_STATE if self.symmetry == "canonical" else STATE

    def canonical_batch(
        self, signature: Signature, state: bool = True, restored: bool = False, packed: bool = False
    ) -> CanonicalBatch:
        """Return the module that prepares batches for these networks.

        Args:
            signature: Signature of the environment.
            state: Whether they read the state.
            restored: Whether actions are in the order of the map.
            packed: Whether to drop the planes that the world cannot fill.
        """
        return self._inputs(signature).batch(state, restored, self._packs and packed)

    _packs: ClassVar[bool] = True
    """Whether they can leave planes out."""

    def _inputs(self, signature: Signature) -> Inputs:
        """Return the inputs of these networks.

        Raises:
            ValueError: If messages come late in several rounds.
        """
        is_late = self.talks and signature.is_late
        if is_late and self.message_rounds > 1:
            raise ValueError(
                "model.message_rounds must be 1 where messages come late (mechanics.radio.delay), "
                f"got {self.message_rounds}"
            )
        return Inputs(signature, is_canonical=self.symmetry == "canonical", is_late=is_late)

    def _of_agents(
        self,
        signature: Signature,
        hidden: tuple[int, ...],
        out: int,
        head_gain: float,
        key: Key,
        *,
        central: bool = False,
        judges: bool = False,
        memory: int = 0,
        talks: bool = False,
    ) -> TensorDictModuleBase:
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
            talks: Whether agents exchange messages.
        """
        inputs = self._inputs(signature)
        names = _read(list(signature.observation), central and not judges)
        entries, keys = [signature.observation[name] for name in names], [inputs.key(name) for name in names]
        if judges:
            entries.append(Entry((signature.n_actions,), "float32"))
            keys.append(inputs.action_key)
        action = len(keys) - 1 if judges else None
        if central:
            joint = [Entry((signature.n_agents * signature.n_actions,), "float32")] if judges else []
            entries = [signature.state, *joint, *entries]
        is_late = talks and inputs.is_late
        network = self._shared(
            signature, lambda: self._network(entries, hidden, out, head_gain, memory, talks, is_late)
        )
        if self.sharing in _INDEX:
            keys.append(_INDEX[self.sharing])
        module: TensorDictModuleBase
        if memory:
            clock = inputs.clock()
            if clock is None:
                raise ValueError(f"model.memory must be 0 where observations have no clock, got {memory}")
            module = RecurrentActor(network, [*keys, *inputs.turned()], out, memory, clock)
        elif central:
            central_network = Central(network, signature.state, action)
            module = TensorDictModule(central_network, in_keys=[inputs.state_key, *keys], out_keys=[key])
        else:
            if talks:
                keys = [RADIO, *inputs.observed(names), *(inputs.observed(names, sent=True) if is_late else [])]
            module = TensorDictModule(network, in_keys=keys, out_keys=[key])
        trust = self.trust if key == LOGITS else 0.0
        return inputs.around(module, state=central, action=judges, sent=is_late, trust=trust)

    def _shared(
        self, signature: Signature, make: Callable[[], Network | RecurrentNetwork | TalkingNetwork]
    ) -> nn.Module:
        """Return as many networks as the team has.

        Raises:
            ValueError: If each agency should have one, and there is but one.
        """
        if self.sharing == "agency" and not signature.agencies:
            raise ValueError("model.sharing must be team, role or none where there is but one agency, got agency")
        if self.sharing == "team":
            return make()
        if self.sharing == "role":
            return IndexedNetworks([make() for _ in range(signature.n_roles)])
        if self.sharing == "agency":
            return IndexedNetworks([make() for _ in signature.agencies])
        networks = [make() for _ in range(signature.n_agents)]
        return AgentNetworks(networks, networks[0].entries)

    def _network(
        self,
        entries: list[Entry],
        hidden: tuple[int, ...],
        out: int,
        head_gain: float,
        memory: int,
        talks: bool,
        is_late: bool,
    ) -> Network | RecurrentNetwork | TalkingNetwork:
        encoder, activation = self._encoder(entries, hidden[0]), ACTIVATIONS[self.activation]
        network = Network(encoder, tuple(hidden), out, activation, head_gain, self.dtype)
        if talks:
            return TalkingNetwork(network, hidden[0], self.message_size, self.message_rounds, is_late)
        return RecurrentNetwork(network, hidden[0], memory) if memory else network

    def _encoder(self, entries: list[Entry], size: int) -> LinearEncoder | ConvolutionalEncoder:
        return LinearEncoder(entries, size)


def _read(names: list[str], has_state: bool) -> list[str]:
    """Return the entries that a network reads: a critic with the state and a picture does not read the view."""
    return [name for name in names if name != "view"] if has_state and {"view", "picture"} <= set(names) else names


def check_sizes(name: str, sizes: tuple[int, ...]) -> None:
    """Check the sizes of layers.

    Raises:
        ValueError: If one is not in 1..8192 or there is none.
    """
    if not sizes or not all(1 <= size <= 8192 for size in sizes):
        raise ValueError(f"{name} must be a list of sizes in 1..8192, got {list(sizes)}")
