"""Networks: an encoder of observations, and the heads of actors and critics.

They know the shapes of what they read, from a ``Signature``, and nothing of the world.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Literal, NamedTuple

import torch
from tensordict.nn import TensorDictModule
from torch import Tensor, nn
from torchrl.envs import EnvBase

ACTION = ("agents", "action")
ACTION_MASK = ("agents", "action_mask")
LOGITS = ("agents", "logits")
LOG_PROB = ("agents", "action_log_prob")
OBSERVATION = ("agents", "observation")
ROLE = ("agents", "role")
REWARD = ("agents", "reward")
VALUE = ("agents", "state_value")


class Entry(NamedTuple):
    """Shape of one agent's (or the critic's) entry, and its type's name."""

    shape: tuple[int, ...]
    dtype: str


class Signature(NamedTuple):
    """What a network must fit: the environment's inputs and outputs, without its size."""

    observation: dict[str, Entry]  # by name; "" where the observation is one tensor
    state: Entry
    n_agents: int
    n_actions: int
    n_roles: int

    def observation_keys(self) -> list[tuple[str, ...]]:
        """Return the tensordict keys of the observation's entries."""
        return [(*OBSERVATION, name) if name else OBSERVATION for name in self.observation]


def signature(env: EnvBase) -> Signature:
    """Read the signature off an environment's specs."""
    specs = env.full_observation_spec_unbatched
    seen = specs[OBSERVATION]
    named = dict(seen.items()) if hasattr(seen, "items") else {"": seen}

    def entry(spec: object, skip: int) -> Entry:
        return Entry(tuple(spec.shape[skip:]), str(spec.dtype).removeprefix("torch."))

    n_agents, n_actions = specs[ACTION_MASK].shape
    observation = {name: entry(spec, 1) for name, spec in sorted(named.items())}
    return Signature(observation, entry(specs["state"], 0), n_agents, n_actions, specs[ROLE].n)


class Encoder(nn.Module):
    """The first layer over several entries: the sum of one linear map each, which equals one of them joined.

    Bytes are read as fractions of 255. Entries may have any number of leading dimensions.

    Args:
        entries: What is read.
        size: Features out.
    """

    def __init__(self, entries: list[Entry], size: int) -> None:
        super().__init__()
        self.entries = entries
        total = sum(_count(entry) for entry in entries)
        self.parts = nn.ModuleList(
            nn.Linear(_count(entry), size, bias=index == 0) for index, entry in enumerate(entries)
        )
        joined = torch.empty(size, total)
        nn.init.orthogonal_(joined, 2.0**0.5)
        for part, weight in zip(self.parts, joined.split([_count(entry) for entry in entries], dim=1), strict=True):
            part.weight.data.copy_(weight)
        nn.init.zeros_(self.parts[0].bias)

    def forward(self, *inputs: Tensor) -> Tensor:
        """Return features, float [..., size]."""
        total = None
        for part, entry, tensor in zip(self.parts, self.entries, inputs, strict=True):
            flat = tensor.flatten(-len(entry.shape)) if len(entry.shape) > 1 else tensor
            if flat.dtype == torch.uint8:
                # Scaling the weights is far cheaper than scaling the many bytes.
                features = nn.functional.linear(_cast(flat, part.weight), part.weight * (1.0 / 255.0), part.bias)
            else:
                features = part(flat)
            total = features if total is None else total + features
        return total


def _count(entry: Entry) -> int:
    return int(torch.Size(entry.shape).numel())


def _cast(tensor: Tensor, like: Tensor) -> Tensor:
    autocast = torch.is_autocast_enabled(tensor.device.type)
    return tensor.to(torch.get_autocast_dtype(tensor.device.type) if autocast else like.dtype)


class Network(nn.Module):
    """An encoder, hidden layers, and a linear head, with orthogonal initialisation.

    Args:
        entries: What is read.
        hidden: Sizes of the hidden layers.
        out: Size of the output.
        activation: Between layers.
        head_gain: Gain of the last layer's initial weights; 0.01 makes a first policy near uniform.
        dtype: Arithmetic of the layers, ``auto``, ``float32`` or ``bfloat16``; weights stay float32.
    """

    def __init__(
        self,
        entries: list[Entry],
        hidden: tuple[int, ...],
        out: int,
        activation: type[nn.Module],
        head_gain: float,
        dtype: str,
    ) -> None:
        super().__init__()
        self.encoder = Encoder(entries, hidden[0])
        layers: list[nn.Module] = [activation()]
        for before, after in pairwise(hidden):
            layers += [_orthogonal(nn.Linear(before, after), 2.0**0.5), activation()]
        self.body = nn.Sequential(*layers, _orthogonal(nn.Linear(hidden[-1], out), head_gain))
        self.dtype = dtype

    def forward(self, *inputs: Tensor) -> Tensor:
        """Return float32 [..., out]."""
        device = inputs[0].device.type
        half = self.dtype == "bfloat16" or (self.dtype == "auto" and computes_in_half(device))
        with torch.autocast(device, dtype=torch.bfloat16, enabled=half, cache_enabled=False):
            return self.body(self.encoder(*inputs)).to(torch.float32)


@lru_cache(maxsize=4)
def computes_in_half(device: str) -> bool:
    """Return whether a kind of device computes in bfloat16 itself; where it does not, emulation is far slower."""
    if device == "cuda":
        return torch.cuda.is_bf16_supported(including_emulation=False)
    supported = getattr(torch.cpu, "_is_avx512_bf16_supported", None)  # no public question says it
    return device == "cpu" and supported is not None and bool(supported())


class TeamValue(nn.Module):
    """A central critic's head: one network over the state, a value for each agent, [..., A, 1]."""

    def __init__(self, network: Network) -> None:
        super().__init__()
        self.network = network

    def forward(self, state: Tensor) -> Tensor:
        """Return float32 [..., A, 1]."""
        return self.network(state).unsqueeze(-1)


class RoleNetworks(nn.Module):
    """One network for each role, chosen by an agent's role index, whatever the team.

    Args:
        networks: By role index.
    """

    def __init__(self, networks: list[Network]) -> None:
        super().__init__()
        self.networks = nn.ModuleList(networks)

    def forward(self, *inputs: Tensor) -> Tensor:
        """Return float32 [..., A, out] from entries [..., A, ...] and, last, roles int64 [..., A]."""
        *entries, role = inputs
        out = self.networks[0](*entries)
        for index, network in enumerate(self.networks):
            out = out if index == 0 else torch.where((role == index)[..., None], network(*entries), out)
        return out


class AgentNetworks(nn.Module):
    """One network for each agent of a team of fixed size.

    Args:
        networks: By agent.
    """

    def __init__(self, networks: list[Network]) -> None:
        super().__init__()
        self.networks = nn.ModuleList(networks)

    def forward(self, *inputs: Tensor) -> Tensor:
        """Return float32 [..., A, out] from entries [..., A, ...]."""
        entries = self.networks[0].encoder.entries
        split = [given.unbind(-1 - len(entry.shape)) for given, entry in zip(inputs, entries, strict=True)]
        own = zip(self.networks, *split, strict=True)
        return torch.stack([network(*seen) for network, *seen in own], dim=-2)


def _orthogonal(layer: nn.Linear, gain: float) -> nn.Linear:
    nn.init.orthogonal_(layer.weight, gain)
    nn.init.zeros_(layer.bias)
    return layer


_ACTIVATIONS = {"tanh": nn.Tanh, "relu": nn.ReLU}


@dataclass(frozen=True, kw_only=True)
class Mlp:
    """Multilayer perceptrons over flattened observations.

    Attributes:
        sharing: ``team`` gives all agents one network, ``role`` one to each role (chosen by the role index, so that
            it fits any team), ``none`` one to each agent (which fits teams of the same size only).
        actor_hidden: Sizes of the actor's hidden layers.
        critic_hidden: Sizes of the critic's.
        activation: ``tanh`` or ``relu``.
        dtype: ``bfloat16`` computes the layers in half precision (weights stay float32), several times faster on
            processors that have it and several times slower on those that have not; ``auto`` takes it where they do.

    Raises:
        ValueError: If a size is not in 1..8192 or there is no hidden layer.
    """

    sharing: Literal["team", "role", "none"] = "team"
    actor_hidden: tuple[int, ...] = (128, 128)
    critic_hidden: tuple[int, ...] = (128, 128)
    activation: Literal["tanh", "relu"] = "tanh"
    dtype: Literal["auto", "float32", "bfloat16"] = "float32"

    def __post_init__(self) -> None:
        for name in ("actor_hidden", "critic_hidden"):
            sizes = getattr(self, name)
            if not sizes or not all(1 <= size <= 8192 for size in sizes):
                raise ValueError(f"{name} must be a list of sizes in 1..8192, got {list(sizes)}")

    def actor(self, signature: Signature) -> TensorDictModule:
        """Return the module that writes logits [..., A, actions] from an agent's own observation."""
        return self._of_agents(signature, self.actor_hidden, signature.n_actions, 0.01, LOGITS)

    def critic(self, signature: Signature, central: bool) -> TensorDictModule:
        """Return the module that writes values [..., A, 1], from the state or from each agent's observation."""
        if central:
            network = self._network([signature.state], self.critic_hidden, signature.n_agents, 1.0)
            return TensorDictModule(TeamValue(network), in_keys=["state"], out_keys=[VALUE])
        return self._of_agents(signature, self.critic_hidden, 1, 1.0, VALUE)

    def _of_agents(
        self, signature: Signature, hidden: tuple[int, ...], out: int, head_gain: float, key: tuple[str, ...]
    ) -> TensorDictModule:
        """Return the module that writes [..., A, out] from each agent's own observation."""
        entries, keys = list(signature.observation.values()), signature.observation_keys()
        count = {"team": 1, "role": signature.n_roles, "none": signature.n_agents}[self.sharing]
        networks = [self._network(entries, hidden, out, head_gain) for _ in range(count)]
        if self.sharing == "role":
            return TensorDictModule(RoleNetworks(networks), in_keys=[*keys, ROLE], out_keys=[key])
        network = networks[0] if self.sharing == "team" else AgentNetworks(networks)
        return TensorDictModule(network, in_keys=keys, out_keys=[key])

    def _network(self, entries: list[Entry], hidden: tuple[int, ...], out: int, head_gain: float) -> Network:
        return Network(entries, tuple(hidden), out, _ACTIVATIONS[self.activation], head_gain, self.dtype)
