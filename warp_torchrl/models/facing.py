"""Networks that hold the map so that the fire lies before them."""

from torch import Tensor, nn

from warp_torchrl.models.signature import ACTION_ONE_HOT, OBSERVATION, STATE
from warp_torchrl.observation.frame import frame_of, held, held_state

Key = str | tuple[str, ...]


class FacingFire(nn.Module):
    """Networks of agents in frames of their own, in which the fire that an agent sees lies between east and south-east.

    What they are given and what they say are of the map; each agent's part is turned and mirrored on the way in and
    back on the way out, and the critic's state as the middle of the team would hold it.

    Args:
        network: Reads entries [..., A, ...] and, where it is central, the state; writes [..., A, out].
        keys: Of what is read, in order.
        chooses: Whether what it writes is an entry for each action.
    """

    def __init__(self, network: nn.Module, keys: list[Key], chooses: bool) -> None:
        super().__init__()
        self.network, self.keys, self.chooses = network, keys, chooses
        self._names = {key: "".join(key[len(OBSERVATION) :]) for key in keys if key[: len(OBSERVATION)] == OBSERVATION}

    def forward(self, *inputs: Tensor) -> Tensor:
        """Return float32 [..., A, out]."""
        given = dict(zip(self.keys, inputs, strict=True))
        frame = frame_of({name: given[key] for key, name in self._names.items()})
        for key, name in self._names.items():
            given[key] = held(name, given[key], frame)
        if STATE in given:
            given[STATE] = held_state(given[STATE])
        if ACTION_ONE_HOT in given:
            given[ACTION_ONE_HOT] = frame.actions(given[ACTION_ONE_HOT])
        out = self.network(*given.values())
        return frame.actions_on_map(out) if self.chooses else out
