"""Networks: encoders of observations, heads, and sharing of networks in a team."""

import operator
from collections.abc import Sequence
from functools import lru_cache, reduce

import torch
from torch import Tensor, nn
from torchrl.modules import MLP, ConvNet

from warp_torchrl.models.packing import own_dims, packing_of
from warp_torchrl.models.signature import Entry


class _Linear(nn.Linear):
    def __init__(self, entry: Entry, size: int, bias: bool) -> None:
        super().__init__(count(entry), size, bias=bias)
        self.dims, self.packing = len(entry.shape), packing_of(entry)

    def forward(self, given: Tensor) -> Tensor:
        weight: Tensor = self.weight
        bias: Tensor | None = self.bias
        unit = 1.0 / 255.0 if given.dtype == torch.uint8 else 1.0
        if self.packing is not None:
            given = self.packing.packed(given)
            weight, added = self.packing.folded(weight)
            bias = _sum(bias, added, unit)
        elif self.dims > 1:
            given = given.flatten(-self.dims)
        if given.dtype == torch.uint8:
            # Scaling the weights is far cheaper than scaling the many bytes.
            given, weight = _cast(given, weight), weight * unit
        return nn.functional.linear(given, weight, bias)


class LinearEncoder(nn.Module):
    """The first layer over several entries: the sum of one linear map each, which equals one of them joined.

    Bytes are read as fractions of 255. Entries may have any number of leading dimensions, and be packed: planes that
    the world cannot fill are left out of the products, and their weights are kept for worlds that can.

    Args:
        entries: What is read.
        size: Features out.
    """

    def __init__(self, entries: list[Entry], size: int) -> None:
        super().__init__()
        self.entries = entries
        counts = [count(entry) for entry in entries]
        parts = [_Linear(each, size, bias=index == 0) for index, each in enumerate(entries)]
        joined = torch.empty(size, sum(counts))
        nn.init.orthogonal_(joined, 2.0**0.5)
        for part, weight in zip(parts, joined.split(counts, dim=1), strict=True):
            part.weight.data.copy_(weight)
        nn.init.zeros_(parts[0].bias)
        self.parts = nn.ModuleList(parts)

    def first_weights(self) -> dict[str, Entry]:
        """Return what each weight reads, by its name: [size, numbers of the entry]."""
        return {f"parts.{index}.weight": entry for index, entry in enumerate(self.entries)}

    def forward(self, *inputs: Tensor) -> Tensor:
        """Return features, float [..., size]."""
        return reduce(operator.add, (part(given) for part, given in zip(self.parts, inputs, strict=True)))


class ConvolutionalEncoder(nn.Module):
    """The first layers over several entries: convolutions over those of three dimensions, then a linear map of all.

    Args:
        entries: Entries that are read; those [C, V, V] as images, the others as vectors.
        size: Features out.
        channels: Output channels of each convolution.
        kernel_size: Of each; the borders are padded, so that an image keeps its size.
        activation: After each convolution.
    """

    def __init__(
        self, entries: list[Entry], size: int, channels: tuple[int, ...], kernel_size: int, activation: type[nn.Module]
    ) -> None:
        super().__init__()
        self.entries = entries
        self.images = nn.ModuleDict()
        flat = []
        for index, entry in enumerate(entries):
            if len(entry.shape) < 3:
                flat.append(entry)
                continue
            self.images[str(index)] = ConvNet(
                in_features=entry.shape[0],
                num_cells=list(channels),
                kernel_sizes=kernel_size,
                paddings=kernel_size // 2,
                activation_class=activation,
            )
            flat.append(Entry((channels[-1] * entry.shape[1] * entry.shape[2],), "float32"))
        self.joined = LinearEncoder(flat, size)

    def first_weights(self) -> dict[str, Entry]:
        """Return what the first convolution over each image reads, by its name: [out, channels, K, K]."""
        return {f"images.{index}.0.weight": self.entries[int(index)] for index in self.images}

    def forward(self, *inputs: Tensor) -> Tensor:
        """Return features, float [..., size]."""
        features = list(inputs)
        for index, network in self.images.items():
            image = inputs[int(index)]
            image = image.to(torch.float32) * (1.0 / 255.0) if image.dtype == torch.uint8 else image
            features[int(index)] = network(image)
        return self.joined(*features)


def count(entry: Entry) -> int:
    """Return how many numbers an entry holds."""
    return int(torch.Size(entry.shape).numel())


def _sum(bias: Tensor | None, added: Tensor | None, unit: float) -> Tensor | None:
    """Return the sum of a bias and another term, in the bias's unit."""
    if added is None:
        return bias
    return added * unit if bias is None else bias + added * unit


def _cast(tensor: Tensor, like: Tensor) -> Tensor:
    autocast = torch.is_autocast_enabled(tensor.device.type)
    return tensor.to(torch.get_autocast_dtype(tensor.device.type) if autocast else like.dtype)


class Network(nn.Module):
    """An encoder, hidden layers, and a linear head, with orthogonal initialisation.

    Args:
        encoder: Writes the first layer's features.
        hidden: Sizes of the hidden layers; the first is the encoder's.
        out: Size of the output.
        activation: Between layers.
        head_gain: Gain of the last layer's initial weights; 0.01 makes a first policy near uniform.
        dtype: Arithmetic of the layers, ``auto``, ``float32`` or ``bfloat16``; weights stay float32.
    """

    def __init__(
        self,
        encoder: LinearEncoder | ConvolutionalEncoder,
        hidden: tuple[int, ...],
        out: int,
        activation: type[nn.Module],
        head_gain: float,
        dtype: str,
    ) -> None:
        super().__init__()
        self.encoder = encoder
        layers = MLP(in_features=hidden[0], out_features=out, num_cells=list(hidden[1:]), activation_class=activation)
        for layer in layers:
            if isinstance(layer, nn.Linear):
                nn.init.orthogonal_(layer.weight, head_gain if layer is layers[-1] else 2.0**0.5)
                nn.init.zeros_(layer.bias)
        self.body = nn.Sequential(activation(), *layers)
        self.dtype = dtype

    @property
    def entries(self) -> list[Entry]:
        """Entries that it reads."""
        return self.encoder.entries

    def forward(self, *inputs: Tensor) -> Tensor:
        """Return float32 [..., out]."""
        with self.arithmetic(inputs[0].device.type):
            return self.body(self.encoder(*inputs)).to(torch.float32)

    def arithmetic(self, device: str) -> torch.autocast:
        """Return the context in which the layers compute on a kind of device."""
        return torch.autocast(device, dtype=torch.bfloat16, enabled=self.is_half(device), cache_enabled=False)

    def is_half(self, device: str) -> bool:
        """Return whether the layers compute in bfloat16 on a kind of device."""
        return self.dtype == "bfloat16" or (self.dtype == "auto" and computes_in_half(device))


@torch.compiler.assume_constant_result
def computes_in_half(device: str) -> bool:
    """Return whether a kind of device has bfloat16; without it, emulation is far slower."""
    return _computes_in_half(device)


@lru_cache(maxsize=4)
def _computes_in_half(device: str) -> bool:
    if device == "cuda":
        return torch.cuda.is_bf16_supported(including_emulation=False)
    supported = getattr(torch.cpu, "_is_avx512_bf16_supported", None)  # no public question says it
    return device == "cpu" and supported is not None and bool(supported())


def arithmetic_of(module: nn.Module, device: str) -> torch.dtype:
    """Return the type in which all networks of a module compute on a kind of device."""
    networks = [each for each in module.modules() if isinstance(each, Network)]
    return torch.bfloat16 if networks and all(each.is_half(device) for each in networks) else torch.float32


class Central(nn.Module):
    """Inputs of a central critic besides those of agents' networks: the common state, and all actions.

    Args:
        network: Reads the state, the joint action where there is one, and then each agent's own entries.
        state: The state's entry.
        action: Place of the one-hot actions among the agents' entries; None where the critic does not judge actions.
    """

    def __init__(self, network: nn.Module, state: Entry, action: int | None) -> None:
        super().__init__()
        self.network, self.state, self.action = network, state, action

    def forward(self, state: Tensor, *own: Tensor) -> Tensor:
        """Return float32 [..., A, out] from the state [...] and entries [..., A, ...]."""
        shared = [state.unsqueeze(-1 - own_dims(state, self.state))]
        if self.action is not None:
            shared.append(own[self.action].flatten(-2).unsqueeze(-2))
        return self.network(*shared, *own)


class IndexedNetworks(nn.Module):
    """One network for each kind of agent, chosen by the agent's index: its role, or the agency that it serves.

    Args:
        networks: By index.
    """

    def __init__(self, networks: Sequence[nn.Module]) -> None:
        super().__init__()
        self.networks = nn.ModuleList(networks)

    def forward(self, *inputs: Tensor) -> Tensor:
        """Return float32 [..., A, out] from entries [..., A, ...] and, last, indices int64 [..., A]."""
        *entries, kind = inputs
        out = self.networks[0](*entries)
        for index, network in enumerate(self.networks):
            out = out if index == 0 else torch.where((kind == index)[..., None], network(*entries), out)
        return out


class AgentNetworks(nn.Module):
    """One network for each agent of a team of fixed size.

    Args:
        networks: By agent.
        entries: What each of them reads.
    """

    def __init__(self, networks: Sequence[nn.Module], entries: list[Entry]) -> None:
        super().__init__()
        self.networks = nn.ModuleList(networks)
        self._entries = entries

    def forward(self, *inputs: Tensor) -> Tensor:
        """Return float32 [..., A, out] from entries [..., A, ...]; one that all share may be [..., 1, ...]."""
        split = []
        for given, entry in zip(inputs, self._entries, strict=True):
            each = given.unbind(-1 - own_dims(given, entry))
            split.append(each * len(self.networks) if len(each) == 1 else each)
        own = zip(self.networks, *split, strict=True)
        return torch.stack([network(*seen) for network, *seen in own], dim=-2)
