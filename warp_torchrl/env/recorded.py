"""A step of the worlds as one recording of a GPU."""

from torch import Tensor

from warp_torchrl.env.scene import Observations, Scene, Step
from warp_torchrl.system.graph import Graph
from warp_torchrl.world.state.state import TreeCounts, WorldState


class RecordedStep:
    """``Scene.step``, recorded.

    Args:
        scene: The rules, what is seen and what is earned. They must stay as they are.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._graph = Graph(self._flat)
        self._like: tuple[WorldState, TreeCounts] | None = None
        self._step: Step | None = None

    def __call__(self, before: WorldState, counts: TreeCounts, action: Tensor) -> Step:
        """Step the worlds, given their counts of trees, with actions int64 [B, A]."""
        self._like = before, counts
        made = self._graph([*before.leaves().values(), *counts.leaves().values(), action])
        if self._step is None:
            raise RuntimeError("a recording has made no step")
        return _with_tensors(self._step, made)

    def _flat(self, given: list[Tensor]) -> list[Tensor]:
        if self._like is None:
            raise RuntimeError("a recording is called with no worlds")
        before, counts = self._like
        *tensors, action = given
        names = list(before.leaves())
        state = before.with_leaves(dict(zip(names, tensors)))
        known = counts.with_leaves(dict(zip(counts.leaves(), tensors[len(names) :])))
        self._step = self.scene.step(state, known, action)
        return _tensors(self._step)


def _tensors(step: Step) -> list[Tensor]:
    seen = step.observations
    parts = step.transition.leaves(), seen.entries, seen.metrics
    optional = [each for each in (seen.state, seen.radio) if each is not None]
    return [*(each for part in parts for each in part.values()), *optional, seen.action_mask, step.reward]


def _with_tensors(like: Step, tensors: list[Tensor]) -> Step:
    *several, mask, reward = tensors
    given, seen = iter(several), like.observations
    transition = like.transition.with_leaves({name: next(given) for name in like.transition.leaves()})
    entries = {name: next(given) for name in seen.entries}
    metrics = {name: next(given) for name in seen.metrics}
    state, radio = (None if each is None else next(given) for each in (seen.state, seen.radio))
    return Step(transition, Observations(entries, mask, metrics, state, radio), reward)
