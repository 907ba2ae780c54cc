"""Networks whose agents talk: attention over the messages that each agent hears."""

from typing import Any

import torch
from torch import Tensor, nn

from warp_torchrl.models.canonical import Orientation
from warp_torchrl.models.networks import Network
from warp_torchrl.models.signature import Entry

RADIO_SCALE = 1.0 / 16.0
"""What a cell of distance is to the networks."""


class Round(nn.Module):
    """One round of messages: each agent sends one, and attends to those that it hears.

    The communication graph changes every step; it is small and dense, so torch's attention over all pairs with a mask
    needs no lists of edges, no scatter and no copies of a batch.

    A message is sent in the orientation of the map (``Orientation.units_back``), and received in that of its receiver,
    with the sender's place relative to the receiver. So turning the map turns the actions of the team as it turns each
    agent's.

    Args:
        size: Features of an agent.
        message: Numbers of a message, a multiple of 8.
        heads: Of the attention.
    """

    def __init__(self, size: int, message: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.send, self.ask = nn.Linear(size, message), nn.Linear(size, message)
        self.hear = nn.Linear(message + 2, 2 * message)
        self.take = nn.Linear(message, size, bias=False)
        for layer in (self.send, self.ask, self.hear):
            nn.init.orthogonal_(layer.weight, 2.0**0.5)
            nn.init.zeros_(layer.bias)
        nn.init.orthogonal_(self.take.weight)

    def told(self, features: Tensor, index: Tensor) -> Tensor:
        """Return the messages that agents send, in the orientation of the map, [..., A, M], numbers in -1..1.

        Args:
            features: [..., A, F].
            index: Of the agents' ``Orientation``, int64 [..., A].
        """
        return Orientation(index).units_back(torch.tanh(self.send(features)))

    def forward(
        self, features: Tensor, radio: Tensor, index: Tensor, sent: tuple[Tensor, Tensor] | None = None
    ) -> Tensor:
        """Return features with the attention over received messages added, [..., A, F].

        Args:
            features: [..., A, F].
            radio: For each agent and each other: 1 if it hears the other, else 0; rows and columns from it to the other
                [cells]; float32 [..., A, A, 3].
            index: Of the agents' ``Orientation``, int64 [..., A].
            sent: Features and index of the messages that arrive now; None: those given.
        """
        told = self.told(*((features, index) if sent is None else sent))
        return self.heard(features, radio, index, told[..., None, :, :].expand(*index.shape, radio.shape[-2], -1))

    def heard(self, features: Tensor, radio: Tensor, index: Tensor, told: Tensor) -> Tensor:
        """Return features with the attention over messages added that each agent may hear, [..., A, F].

        Args:
            features: [..., A, F].
            radio: As in ``forward``, of n others, float32 [..., A, n, 3].
            index: Of the agents' ``Orientation``, int64 [..., A].
            told: Messages of the others in the orientation of the map, [..., A, n, M].
        """
        own = Orientation(index[..., None].expand(*index.shape, radio.shape[-2]))
        place = own.offsets(radio[..., 1:] * RADIO_SCALE).to(told.dtype)
        key, value = self.hear(torch.cat((own.units(told), place), dim=-1)).chunk(2, dim=-1)
        nothing = torch.zeros_like(key[..., :1, :])  # attended to by whom nobody reaches
        keys, values = (self._by_head(torch.cat((each, nothing), dim=-2)) for each in (key, value))
        hears = nn.functional.pad(radio[..., 0] > 0.5, (0, 1), value=True).flatten(0, -2)[:, None, None]
        query = self._by_head(self.ask(features)[..., None, :])
        found = nn.functional.scaled_dot_product_attention(query, keys, values, attn_mask=hears)
        return features + self.take(found.transpose(1, 2).reshape(*index.shape, -1))

    def _by_head(self, given: Tensor) -> Tensor:
        """Return [..., A, n, M] as [all, heads, n, M / heads]."""
        return given.flatten(0, -3).unflatten(-1, (self.heads, -1)).transpose(1, 2)


class TalkingNetwork(nn.Module):
    """A network whose agents exchange messages beside its first layer, in some rounds, before they act.

    Decentralised, an agent needs its entries, and the messages that it hears: one per sender and round. Gradients flow
    from an agent's output into the messages that it received (Sukhbaatar et al. 2016, "Learning multiagent
    communication with backpropagation"; over graphs by attention, as in Das et al. 2019, "TarMAC").

    Late messages are made from their senders' observations at the time of sending, in one round: a second round would
    answer messages that have not arrived.

    Args:
        network: The network without talk; rounds are computed in float32 whatever its arithmetic.
        size: Features of its first layer.
        message: Numbers of a message, a multiple of 8.
        rounds: Rounds of messages in a step, 1 if messages arrive late.
        is_late: Whether messages arrive late.
        heads: Of the attention.
    """

    def __init__(
        self, network: Network, size: int, message: int, rounds: int, is_late: bool = False, heads: int = 4
    ) -> None:
        super().__init__()
        self.network, self.is_late, self.message = network, is_late, message
        self.rounds = nn.ModuleList(Round(size, message, heads) for _ in range(rounds))

    @property
    def entries(self) -> list[Entry]:
        """Entries that it reads for each agent, besides the radio and the orientation."""
        return self.network.entries

    def forward(self, radio: Tensor, *inputs: Tensor) -> Tensor:
        """Return float32 [..., A, out].

        Args:
            radio: float32 [..., A, A, 3] as in ``Round.forward``.
            inputs: Entries [..., A, ...], and the index of the agents' ``Orientation`` int64 [..., A], where they have
                one. Where messages come late the same follows, of the time when what arrives now was sent.
        """
        count = len(inputs) // 2 if self.is_late else len(inputs)
        device, network = radio.device.type, self.network
        features, index = self._features(*inputs[:count])
        with torch.autocast(device, enabled=False):
            for each in self.rounds:
                sent = self._features(*inputs[count:]) if self.is_late else None
                features = each(features, radio, index, sent)
        with network.arithmetic(device):
            return network.body[1:](features).to(torch.float32)

    def exchange(self, radio: Tensor, told: Tensor, *inputs: Tensor) -> tuple[Tensor, Tensor]:
        """Return the outputs float32 [..., A, out] and the messages to send [..., A, M], where there is one round.

        Args:
            radio: float32 [..., A, n, 3] as in ``Round.heard``.
            told: Messages of the n others, [..., A, n, M].
            inputs: Present entries and index, as in ``forward``.
        """
        only: Any = self.rounds[0]
        features, index = self._features(*inputs)
        with torch.autocast(radio.device.type, enabled=False):
            sends, features = only.told(features, index), only.heard(features, radio, index, told)
        with self.network.arithmetic(radio.device.type):
            return self.network.body[1:](features).to(torch.float32), sends

    def _features(self, *inputs: Tensor) -> tuple[Tensor, Tensor]:
        """Return the first layer's features, float32 [..., A, F], and the index of the agents' ``Orientation``."""
        seen, turned = inputs[: len(self.entries)], inputs[len(self.entries) :]
        with self.network.arithmetic(inputs[0].device.type):
            features = self.network.body[0](self.network.encoder(*seen)).to(torch.float32)
        return features, turned[0] if turned else torch.zeros_like(features[..., 0], dtype=torch.int64)
