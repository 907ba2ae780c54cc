"""RLlib's PPO with its action masks on a team; in an environment of its own, since RLlib pins its Gymnasium."""

import argparse

from gymnasium.spaces import Dict
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.rllib.core.rl_module.rl_module import RLModuleSpec
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from ray.rllib.examples.rl_modules.classes.action_masking_rlm import ActionMaskingTorchRLModule

from warp_torchrl.api.adapters import parallel_env


def renamed(entries):
    """Return what RLlib calls ``observations``, and the mask beside it."""
    return {"observations": entries["observation"], "action_mask": entries["action_mask"]}


class Wildfire(ParallelPettingZooEnv):
    """A team whose observations are under RLlib's names; arguments of ``parallel_env``."""

    def __init__(self, config):
        super().__init__(parallel_env(**config, layout="flat"))
        self.observation_spaces = {name: Dict(renamed(self.par_env.observation_space(name))) for name in self.agents}
        self.action_spaces = dict(self.action_space)
        self.observation_space = Dict(self.observation_spaces)

    def reset(self, **given):
        """Start an episode."""
        seen, infos = super().reset(**given)
        return {name: renamed(each) for name, each in seen.items()}, infos

    def step(self, actions):
        """Let every agent act."""
        seen, *rest = super().step(actions)
        return {name: renamed(each) for name, each in seen.items()}, *rest


def main(steps: int) -> None:
    """Train two bulldozers that share one policy; without a seed, each runner has fires of its own."""
    config = (
        PPOConfig()
        .environment(Wildfire, env_config={"scenario": "skirmish"})
        .env_runners(num_env_runners=2, rollout_fragment_length=min(steps // 2, 256))
        .multi_agent(policies={"team"}, policy_mapping_fn=lambda *_, **__: "team")
        .rl_module(
            rl_module_spec=RLModuleSpec(
                module_class=ActionMaskingTorchRLModule, model_config=DefaultModelConfig(fcnet_hiddens=[64, 64])
            )
        )
        .training(train_batch_size_per_learner=min(steps, 512), minibatch_size=min(steps, 128), num_epochs=2)
    )
    algorithm, taken = config.build_algo(), 0
    while taken < steps:
        taken = algorithm.train()["num_env_steps_sampled_lifetime"]
    algorithm.stop()
    print(f"{int(taken)} world steps")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=20_000, help="world steps to train for")
    main(parser.parse_args().steps)
