"""How teams of other libraries play the 256 fires that `python evaluate.py` compares policies by."""

import torch

from warp_torchrl import make_env

VIEW, STATUS = (("agents", "observation", name) for name in ("view", "status"))
MASK, ACTION = ("agents", "action_mask"), ("agents", "action")


def flat(view, status):
    """Return views, uint8 [..., A, C, rows, columns], and numbers [..., A, n] as vectors, float32 [..., A, m]."""
    return torch.cat((view.flatten(-3) / 255, status), dim=-1)


def tell(policy, steps, minutes):
    """Print the share of trees that a policy, a module on tensordicts, saves, after so many world steps."""
    env = make_env("skirmish", n_worlds=256, seed=1_000_000)
    with torch.no_grad():
        played = env.rollout(env.world.horizon, policy, break_when_any_done=False)["next"]
    first = played["done"].flatten(1).to(torch.uint8).argmax(dim=1)
    saved = 100 * played["info", "saved"].flatten(1).gather(1, first[:, None])
    error = 1.96 * saved.std() / len(saved) ** 0.5
    print(f"{steps} world steps in {minutes:g} minutes: {saved.mean():.1f} +- {error:.1f} % saved")
