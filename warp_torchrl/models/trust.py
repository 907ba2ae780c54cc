"""Trust in an adviser: agents whose own judgement is not sure do what they are advised."""

from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from warp_torchrl.models.signature import LOGITS, Entry, Key
from warp_torchrl.symmetry import ADVICE

TEAM = "rule_team"
"""Name of the number that tells the size of the team, log2(A) / 8."""


class Trust(TensorDictModuleBase):
    """Raises the logit of the action that an agent is advised to take.

        logit_a += trust log2(A) [a is advised]

    So an agent does otherwise where its logit of another action is higher by as much. Of a larger team each agent's
    part in what the team earns is smaller, and what it learned of it more noise.

    Args:
        key: Of the vector that tells the advice and the size of the team.
        entry: That vector.
        actions: Names of the actions, in the order of the logits.
        trust: The number.

    Raises:
        ValueError: If the vector lacks one of them.
    """

    def __init__(self, key: Key, entry: Entry, actions: tuple[str, ...], trust: float) -> None:
        super().__init__()
        wanted = [TEAM, *(f"{ADVICE}{action}" for action in actions)]
        if not set(wanted) <= set(entry.names):
            raise ValueError(
                "model.trust must be 0 where agents are not advised and told the rules, observation.advice and "
                f"observation.rules, got {trust}"
            )
        self.in_keys, self.out_keys = [LOGITS, key], [LOGITS]
        self._team, *self._advice = (entry.names.index(name) for name in wanted)
        self._gain = 8.0 * trust

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the logits [..., A, actions] with trust."""
        logits, told = (tensordict.get(key) for key in self.in_keys)
        gain = self._gain * told[..., self._team, None].to(logits.dtype)
        return tensordict.set(LOGITS, logits + gain * told[..., self._advice].to(logits.dtype))
