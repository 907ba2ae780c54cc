"""Stable-Baselines3's MaskablePPO on a batch of our worlds, for so many minutes (extra `interop`).

python docs/peers/with_sb3.py --minutes 10
"""

import argparse
import time

import gymnasium
import numpy as np
import torch
from playing import ACTION, MASK, STATUS, VIEW, flat, tell
from sb3_contrib import MaskablePPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv
from tensordict.nn import TensorDictModule
from torchrl.envs.utils import step_mdp

from warp_torchrl import make_env


class AgentsOfWorlds(VecEnv):
    """Each agent of each world is an environment of its own, as SuperSuit has it, without a process or a copy."""

    def __init__(self, env):
        self.worlds, shown = env, env.reset()
        (self.size, agents), width = shown[MASK].shape[:2], flat(shown[VIEW], shown[STATUS]).shape[-1]
        self.masks = None
        super().__init__(
            self.size * agents,
            gymnasium.spaces.Box(-np.inf, np.inf, (width,), np.float32),
            gymnasium.spaces.Discrete(shown[MASK].shape[-1]),
        )

    def _shown(self):
        self.masks = self.now[MASK].flatten(0, 1).numpy()
        return flat(self.now[VIEW], self.now[STATUS]).flatten(0, 1).numpy()

    def reset(self):
        """Return the first observations, float32 [B * A, n]."""
        self.now = self.worlds.reset()
        return self._shown()

    def step_async(self, actions):
        """Keep the actions."""
        self.now.set(ACTION, torch.as_tensor(actions).view(self.size, -1))

    def step_wait(self):
        """Return observations, rewards, ends and what ended so."""
        stepped = self.worlds.step(self.now)
        reward = stepped["next", "agents", "reward"].flatten().numpy()
        agents = self.num_envs // self.size
        done, cut = (stepped["next", key].expand(-1, agents).flatten().numpy() for key in ("done", "truncated"))
        last, infos = stepped["next"], [{} for _ in range(self.num_envs)]
        if done.any():
            seen = flat(last[VIEW], last[STATUS]).flatten(0, 1).numpy()
            for index in done.nonzero()[0]:
                infos[index] = {"terminal_observation": seen[index], "TimeLimit.truncated": bool(cut[index])}
        self.now = self.worlds.maybe_reset(step_mdp(stepped))
        return self._shown(), reward, done, infos

    def env_method(self, method_name, *method_args, indices=None, **method_kwargs):
        """Return the masks, which MaskablePPO asks for."""
        return list(self.masks)

    def has_attr(self, attr_name):
        """Return whether it is the masks that are asked for."""
        return attr_name == "action_masks"

    def get_attr(self, attr_name, indices=None):
        """Return nothing of an environment."""
        return [None] * self.num_envs

    def set_attr(self, attr_name, value, indices=None):
        """Refuse."""
        raise AttributeError(attr_name)

    def env_is_wrapped(self, wrapper_class, indices=None):
        """Return that none is wrapped."""
        return [False] * self.num_envs

    def close(self):
        """End the worlds."""
        self.worlds.close()


class Until(BaseCallback):
    """Stops a training after so many minutes."""

    def __init__(self, minutes):
        super().__init__()
        self.end = time.monotonic() + 60 * minutes

    def _on_step(self):
        return time.monotonic() < self.end


def main(minutes: float, seed: int, worlds: int) -> None:
    """Train a team, and let it play the fires that all policies are compared by."""
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    env = AgentsOfWorlds(make_env("skirmish", n_worlds=worlds, seed=seed))
    model = MaskablePPO(
        "MlpPolicy", env, n_steps=32, batch_size=1024, policy_kwargs={"net_arch": [256, 256]}, seed=seed
    )
    model.learn(10**9, callback=Until(minutes))

    def acts(view, status, mask):
        seen = flat(view, status)
        chosen, _ = model.predict(
            seen.flatten(0, 1).numpy(), action_masks=mask.flatten(0, 1).numpy(), deterministic=True
        )
        return torch.as_tensor(chosen).view(mask.shape[:2])

    steps = model.num_timesteps * worlds // env.num_envs
    tell(TensorDictModule(acts, in_keys=[VIEW, STATUS, MASK], out_keys=[ACTION]), steps, minutes)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--worlds", type=int, default=64)
    main(**vars(parser.parse_args()))
