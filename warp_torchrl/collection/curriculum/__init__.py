"""Automatic curricula: levels of a scenario, drawn by the team's results."""

from warp_torchrl.collection.curriculum.curriculum import Curriculum, NoCurriculum
from warp_torchrl.collection.curriculum.regret import Regret
from warp_torchrl.collection.curriculum.state import CurriculumState
from warp_torchrl.collection.curriculum.success import Success

__all__ = ["Curriculum", "CurriculumState", "NoCurriculum", "Regret", "Success"]
