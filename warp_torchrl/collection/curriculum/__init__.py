"""Auto-curricula: which level of its scenario a training plays, by how well the team does."""

from warp_torchrl.collection.curriculum.curriculum import Curriculum, NoCurriculum
from warp_torchrl.collection.curriculum.regret import Regret
from warp_torchrl.collection.curriculum.standing import Standing
from warp_torchrl.collection.curriculum.success import Success

__all__ = ["Curriculum", "NoCurriculum", "Regret", "Standing", "Success"]
