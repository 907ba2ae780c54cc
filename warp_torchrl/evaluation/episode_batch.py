"""Episodes of many worlds in one batch, without the worlds that have ended and outputs that nobody reads."""

from collections.abc import Callable, Sequence

import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.metrics import metrics
from warp_torchrl.heuristics import Heuristic
from warp_torchrl.models import ACTION, ACTION_MASK, AGENCY, OBSERVATION, ROLE
from warp_torchrl.runs.policies.trained import scores
from warp_torchrl.system.finite import check_scores
from warp_torchrl.world.state.cells import count_trees
from warp_torchrl.world.state.state import Transition

Watcher = Callable[[Transition, Tensor], None]
"""Called with the transition of each step, and the rows of its worlds, int64 [n]."""


_PART = 16
"""Worlds go on without those that have ended when these are one in so many."""


class EpisodeBatch:
    """One episode of each world of an environment, equal to a loop over its steps, number for number.

    Args:
        env: Environment, at the start of its episodes.
        policies: Policies that pass ``fits``: one, or heuristics that play equal shares of the worlds, in order.
        watcher: Called at each step.
    """

    def __init__(
        self, env: WildfireEnv, policies: Sequence[TensorDictModuleBase], watcher: Watcher | None = None
    ) -> None:
        self.env, self.world, self.policies, self.watcher = env, env.world, policies, watcher
        self.ended, self.state, self.counts = env.shared_state.clone(), env.shared_state, env.tree_counts
        self.rows = torch.arange(env.batch_size[0], device=env.device)
        self.paid = torch.zeros(env.batch_size[0], device=env.device)

    def play(self, shown: TensorDict) -> dict[str, Tensor]:
        """Play to the end and return the metrics of ``info`` by name, float32 [B] each.

        Args:
            shown: The first observations.
        """
        self._leave_ended()
        for _ in range(self.world.horizon):
            if not len(self.rows):
                break
            self._step(self._actions(shown))
            self._leave_ended()
            if not isinstance(self.policies[0], Heuristic):
                self._show(shown)
        self.ended[self.rows] = self.state
        found = metrics(self.ended, count_trees(self.ended), self.world)
        return found | {"episode_reward": self.paid, "episode_length": self.ended.step.to(torch.float32)}

    def _actions(self, shown: TensorDict) -> Tensor:
        """Return the actions in the worlds that continue, int64 [n, A].

        A trained policy acts in all worlds, so that its draws are those of a loop over all.
        """
        if not isinstance(self.policies[0], Heuristic):
            acted = self.policies[0](shown.copy())
            check_scores(scores(acted))
            return acted[ACTION].index_select(0, self.rows)
        mask, share = self.world.possible_actions(self.state), len(self.paid) // len(self.policies)
        last = torch.arange(1, len(self.policies) + 1, device=self.rows.device) * share
        ends = torch.searchsorted(self.rows, last).tolist()
        own = [slice(*each) for each in zip([0, *ends], ends)]
        return torch.cat([each.act(self.state[at], mask[at]) for each, at in zip(self.policies, own) if len(mask[at])])

    def _step(self, action: Tensor) -> None:
        transition = self.world.step(self.state, action, self.counts)
        self.paid.index_add_(0, self.rows, self.env.reward_function(transition).mean(1)[:, 0])
        if self.watcher is not None:
            self.watcher(transition, self.rows)
        self.state, self.counts = transition.after, transition.counts_after

    def _leave_ended(self) -> None:
        """Store ended worlds and drop them from the batch, once they are a sixteenth: moving the others takes time."""
        done = self.state.done
        count = int(done.sum())
        if count < len(done) and count * _PART < len(done):
            return
        ended, going = done.nonzero()[:, 0], (~done).nonzero()[:, 0]
        self.ended[self.rows[ended]] = self.state[ended]
        self.state, self.counts, self.rows = self.state[going], self.counts[going], self.rows[going]

    def _show(self, shown: TensorDict) -> None:
        """Write the observations of the worlds that continue."""
        if not len(self.rows):
            return
        seen = self.env.observation(self.state, self.world, self.world.forecast(self.state))
        keys = {(*OBSERVATION, name) if name else OBSERVATION: value for name, value in seen.items()}
        serves = self.world.agencies.serves(self.state)
        agencies = {} if serves is None else {AGENCY: serves}
        for key, value in {**keys, **agencies, ACTION_MASK: self.world.action_mask(self.state)}.items():
            shown.get(key).index_copy_(0, self.rows, value)


def fits(env: WildfireEnv, policy: TensorDictModuleBase) -> bool:
    """Return whether a policy reads what a match shows: a heuristic its worlds, a trained policy each agent's own.

    One that remembers what it did in the worlds before, a user's own heuristic, which may read the environment, and an
    environment that is watched take a loop over all.
    """
    if env.watcher is not None:
        return False
    if isinstance(policy, Heuristic):
        return not policy.is_stateful and type(policy).__module__.startswith("warp_torchrl.")
    heuristics = any(isinstance(each, Heuristic) for each in policy.modules())
    keys = [key if isinstance(key, tuple) else (key,) for key in policy.in_keys]
    own = all(key in (ACTION_MASK, ROLE, AGENCY) or key[: len(OBSERVATION)] == OBSERVATION for key in keys)
    return own and not heuristics
