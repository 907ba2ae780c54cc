"""The paper's training: Stable-Baselines3's PPO, through SuperSuit, on the NumPy environment."""

from collections.abc import Callable
from importlib.util import find_spec

import torch

from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.benchmark.environments import paper_stack
from warp_torchrl.models import Mlp
from warp_torchrl.runs.config.run_config import RunConfig

NAME = "SuperSuit + SB3 PPO"


def reason_against(run_config: RunConfig) -> str | None:
    """Return why Stable-Baselines3 cannot train these settings; None if it can."""
    missing = [name for name in ("supersuit", "stable_baselines3") if find_spec(name) is None]
    if missing:
        return f"{' and '.join(missing)} not installed (extra interop)"
    if not isinstance(run_config.algorithm, Ppo) or type(run_config.model) is not Mlp:
        return "it trains algorithms mappo, ippo and ppo with model mlp"
    return None


def open_stable_baselines(run_config: RunConfig) -> tuple[Callable[[], object], Callable[[], None]]:
    """Return a function that learns from one batch of the settings' size, and a function that closes the worlds.

    Networks, epochs, minibatch, worlds and steps are those of the run; each agent has a sample per step, as SB3
    counts them.

    Args:
        run_config: Configuration with an algorithm ``Ppo`` and a model ``Mlp``.
    """
    import stable_baselines3
    import supersuit

    algorithm, model, n_agents = run_config.algorithm, run_config.model, run_config.world.team.n_agents
    one = supersuit.pettingzoo_env_to_vec_env_v1(paper_stack(run_config.world, run_config.observation.radius))
    processes = min(torch.get_num_threads(), run_config.n_worlds)  # 1: in this process
    worlds = supersuit.concat_vec_envs_v1(one, run_config.n_worlds, num_cpus=processes, base_class="stable_baselines3")
    learner = stable_baselines3.PPO(
        "MlpPolicy",
        worlds,
        learning_rate=algorithm.learning_rate,
        n_steps=run_config.collector.steps,
        batch_size=min(algorithm.minibatch_size * n_agents, run_config.collector.steps * worlds.num_envs),
        n_epochs=algorithm.epochs,
        gamma=algorithm.gamma,
        gae_lambda=algorithm.lmbda,
        clip_range=algorithm.clip_epsilon,
        ent_coef=algorithm.entropy_coeff,
        vf_coef=algorithm.critic_coeff,
        max_grad_norm=algorithm.max_grad_norm,
        policy_kwargs={
            "net_arch": {"pi": list(model.actor_hidden), "vf": list(model.critic_hidden)},
            "activation_fn": {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU}[model.activation],
        },
        seed=None,
        device=run_config.device,
    )
    total = run_config.collector.steps * worlds.num_envs

    def learn() -> object:
        return learner.learn(total, reset_num_timesteps=False)

    return learn, worlds.close
