"""Auto-curricula: which level of its scenario a training plays, by how well the team does."""

from warp_torchrl.curriculum.curriculum import Curriculum, NoCurriculum
from warp_torchrl.curriculum.regret import Regret
from warp_torchrl.curriculum.standing import Standing
from warp_torchrl.curriculum.success import Success

__all__ = ["Curriculum", "NoCurriculum", "Regret", "Standing", "Success"]
