"""Trust in an adviser: unsure agents follow the advice."""

from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from warp_torchrl.entries import ADVICE, LARGEST_TEAM, TEAM_SIZE
from warp_torchrl.models.signature import LOGITS, Key


def trust_entries(actions: tuple[str, ...]) -> list[str]:
    """Return the names of the numbers that ``Trust`` reads: the size of the team, and the advice by action."""
    return [TEAM_SIZE, *(f"{ADVICE}{action}" for action in actions)]


class Trust(TensorDictModuleBase):
    """Raises the logit of the action that an agent is advised to take.

        logit_a += trust log2(A) [a is advised]

    So an agent acts otherwise where its logit of another action is higher by as much. In a larger team each agent has a
    smaller part in the team's reward, and learns that part with more noise.

    Args:
        key: Key of the vector with the numbers of ``trust_entries``.
        names: Names of that vector's numbers, in order.
        actions: Names of the actions, in the order of the logits.
        trust: Added for each doubling of the team.
    """

    def __init__(self, key: Key, names: tuple[str, ...], actions: tuple[str, ...], trust: float) -> None:
        super().__init__()
        self.in_keys, self.out_keys = [LOGITS, key], [LOGITS]
        self._team, *self._advice = (names.index(name) for name in trust_entries(actions))
        self._gain = trust * LARGEST_TEAM

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the logits [..., A, actions] with trust."""
        logits, told = (tensordict.get(key) for key in self.in_keys)
        gain = self._gain * told[..., self._team, None].to(logits.dtype)
        return tensordict.set(LOGITS, logits + gain * told[..., self._advice].to(logits.dtype))
