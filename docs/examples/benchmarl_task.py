"""A BenchMARL task, and its MAPPO on it; in an environment of its own, since BenchMARL wants an older TorchRL."""

# ruff: noqa: D102  BenchMARL's TaskClass says what each method is

import argparse
from pathlib import Path

from benchmarl.algorithms import MappoConfig
from benchmarl.environments.common import TaskClass
from benchmarl.experiment import Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig
from torchrl.data import Composite

from warp_torchrl import make_env


def of_agents(env, entry):
    """Return the spec of one entry of the agents, as BenchMARL wants it."""
    spec = env.full_observation_spec_unbatched["agents"]
    return Composite(agents=Composite({entry: spec[entry]}, shape=spec.shape))


class Wildfire(TaskClass):
    """One of ``conf/scenario``."""

    def get_env_fun(self, num_envs, continuous_actions, seed, device):
        overrides = ["observation=paper"]  # BenchMARL's perceptrons read flat views
        return lambda: make_env(self.name, n_worlds=num_envs, seed=seed or 0, device=device, overrides=overrides)

    def supports_continuous_actions(self):
        return False

    def supports_discrete_actions(self):
        return True

    def max_steps(self, env):
        return env.world.horizon

    def has_render(self, env):
        return False

    def group_map(self, env):
        return env.group_map

    def observation_spec(self, env):
        return of_agents(env, "observation")

    def action_mask_spec(self, env):
        return of_agents(env, "action_mask")

    def action_spec(self, env):
        return env.full_action_spec_unbatched

    def info_spec(self, env):
        return None

    def state_spec(self, env):
        return None  # the central critic then reads all agents' observations

    @staticmethod
    def env_name():
        return "wildfire"


def main(steps: int) -> None:
    """Train a team with BenchMARL's MAPPO."""
    plan = ExperimentConfig.get_from_yaml()
    plan.loggers, plan.create_json, plan.evaluation, plan.render = [], False, False, False
    plan.on_policy_n_envs_per_worker, plan.on_policy_collected_frames_per_batch = 16, 256
    plan.on_policy_n_minibatch_iters, plan.on_policy_minibatch_size = 3, 64
    plan.max_n_frames, plan.save_folder = steps, "outputs"
    Path(plan.save_folder).mkdir(exist_ok=True)
    experiment = Experiment(
        task=Wildfire("skirmish", {}),
        algorithm_config=MappoConfig.get_from_yaml(),
        model_config=MlpConfig.get_from_yaml(),
        critic_model_config=MlpConfig.get_from_yaml(),
        seed=0,
        config=plan,
    )
    experiment.run()
    print(f"{experiment.total_frames} world steps")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=100_000, help="world steps to train for")
    main(parser.parse_args().steps)
