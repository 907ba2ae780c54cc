"""BenchMARL's MAPPO on our worlds, for so many minutes; in an environment of its own, as docs/interop.md has it.

python docs/peers/with_benchmarl.py --minutes 10
"""

import argparse
import sys
import time
from contextlib import suppress
from pathlib import Path

import torch
from benchmarl.algorithms import MappoConfig
from benchmarl.experiment import Callback, Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.envs import CatTensors, Compose, TransformedEnv, UnaryTransform
from torchrl.envs.utils import ExplorationType, set_exploration_type

from warp_torchrl import make_env

sys.path.append(str(Path(__file__).parents[1] / "examples"))
from benchmarl_task import Wildfire
from playing import ACTION, MASK, STATUS, VIEW, flat, tell

SEEN = ("agents", "observation", "all")


def flattened(env):
    """Return an environment whose agents see one vector."""
    numbers = UnaryTransform(in_keys=[VIEW], out_keys=[VIEW], fn=lambda view: view.flatten(-3) / 255)
    return TransformedEnv(env, Compose(numbers, CatTensors(in_keys=[VIEW, STATUS], out_key=SEEN, sort=False)))


class Skirmish(Wildfire):
    """The task of the table, with the observation that our learners have."""

    def get_env_fun(self, num_envs, continuous_actions, seed, device):
        """Return what makes the worlds."""
        return lambda: flattened(make_env("skirmish", n_worlds=num_envs, seed=seed or 0, device=device))


class TimeIsUpError(Exception):
    """The minutes are over."""


class Until(Callback):
    """Ends a training after so many minutes: BenchMARL's loop counts frames alone."""

    def __init__(self, minutes):
        super().__init__()
        self.end = time.monotonic() + 60 * minutes

    def on_train_end(self, training_td, group):
        """Leave the loop."""
        if time.monotonic() > self.end:
            raise TimeIsUpError


def main(minutes: float, seed: int, worlds: int, as_shipped: bool) -> None:
    """Train a team, and let it play the fires that all policies are compared by."""
    torch.set_num_threads(1)
    config = ExperimentConfig.get_from_yaml()
    config.loggers, config.create_json, config.evaluation, config.render = [], False, False, False
    config.on_policy_n_envs_per_worker, config.on_policy_collected_frames_per_batch = worlds, 96 * worlds
    if not as_shipped:  # the numbers of Stable-Baselines3's PPO
        config.lr, config.on_policy_n_minibatch_iters, config.on_policy_minibatch_size = 3e-4, 10, 1024
    config.max_n_frames, config.save_folder = 10**9, "outputs"
    Path(config.save_folder).mkdir(exist_ok=True)
    network = MlpConfig(num_cells=[256, 256], layer_class=nn.Linear, activation_class=nn.Tanh)
    experiment = Experiment(
        task=Skirmish("skirmish", {}),
        algorithm_config=MappoConfig.get_from_yaml(),
        model_config=network,
        critic_model_config=network,
        seed=seed,
        config=config,
        callbacks=[Until(minutes)],
    )
    with suppress(TimeIsUpError):
        experiment.run()

    def acts(view, status, mask):
        agents = TensorDict({"observation": {"all": flat(view, status)}, "action_mask": mask}).auto_batch_size_(2)
        with set_exploration_type(ExplorationType.DETERMINISTIC):
            return experiment.policy(TensorDict({"agents": agents}, batch_size=len(mask)))[ACTION]

    tell(TensorDictModule(acts, in_keys=[VIEW, STATUS, MASK], out_keys=[ACTION]), experiment.total_frames, minutes)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--worlds", type=int, default=64)
    parser.add_argument("--as-shipped", action="store_true", help="with BenchMARL's rate, passes and minibatches")
    main(**vars(parser.parse_args()))
