"""Steps of recordings as NumPy arrays in one file, for other programs."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from tensordict import TensorDictBase

from warp_torchrl.demonstrations.recording import Recording
from warp_torchrl.system import disk


def arrays(recordings: Sequence[Recording]) -> dict[str, np.ndarray]:
    """Return the steps of recordings one after another, N in all, of teams of one shape.

    Returns:
        Every entry of ``Recording.steps`` by its name with slashes, ``agents/action`` [N, A] for one; ``episode``,
        which recording a step is of, int64 [N], and ``step``, which of its steps, int64 [N]; and the names ``agents``
        [A], ``actions`` and ``scenarios`` [episodes].

    Raises:
        ValueError: If the teams, their actions or what their agents see differ.
    """
    first = recordings[0]
    for each in recordings[1:]:
        for what, one, other in (
            ("agents", first.agents, each.agents),
            ("actions", first.actions, each.actions),
            ("entries", _shapes(first.steps), _shapes(each.steps)),
        ):
            if one != other:
                raise ValueError(
                    f"recordings must be of teams of one shape to be exported together: {first.scenario} of seed "
                    f"{first.seed} and {each.scenario} of seed {each.seed} have other {what}"
                )
    found = {
        name: np.concatenate([each.steps[key].numpy() for each in recordings])
        for name, key in ((_name(key), key) for key in first.steps.keys(include_nested=True, leaves_only=True))
    }
    counts = [len(each.steps) for each in recordings]
    return found | {
        "episode": np.repeat(np.arange(len(counts)), counts),
        "step": np.concatenate([np.arange(count) for count in counts]),
        "agents": np.array(first.agents),
        "actions": np.array(first.actions),
        "scenarios": np.array([each.scenario for each in recordings]),
    }


def export_arrays(recordings: Sequence[Recording], path: Path) -> None:
    """Write ``arrays`` of recordings as a compressed ``.npz`` file without pickles.

    Raises:
        ValueError: If the teams differ in shape.
        OSError: If the write fails, with the path; nothing is left.
    """
    content = arrays(recordings)
    with disk.drafted(path) as draft, draft.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **content)  # type: ignore[arg-type]


def _shapes(steps: TensorDictBase) -> dict[str, tuple[str, tuple[int, ...]]]:
    entries = steps.items(include_nested=True, leaves_only=True)
    return {_name(key): (str(value.dtype), tuple(value.shape[1:])) for key, value in entries}


def _name(key: str | tuple[str, ...]) -> str:
    return key if isinstance(key, str) else "/".join(key)
