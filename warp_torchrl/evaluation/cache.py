"""Disk cache of baselines' episodes, by the digest of everything that determines them.

A file's name is a digest of the world and the reward (every field of every component, layers of rasters and arrays
too), the seeds, the heuristic, the sources of the code that plays them, torch, and the kind of device. So a world that
differs in anything has another file, and after a change of the code old files are not read. Each file holds the sha256
of its content: a cut or altered file is played again and replaced. It is JSON, and is written whole or not at all.
"""

import json
import logging
import os
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import torch

import warp_torchrl
from warp_torchrl.evaluation.play import Episodes
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.destination import LARGEST_EVALUATION
from warp_torchrl.system import disk, foreign
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.team.abilities import ABILITIES

log = logging.getLogger("warp_torchrl")
_PACKAGE = Path(warp_torchrl.__file__).parent
_SOURCES = ("world", "heuristics", "env", "evaluation", "system")
_OURS = "warp_torchrl."
_MOST_EPISODES = 65_536


class Unknown(Exception):  # noqa: N818
    """The episodes have no digest: a component or a value is not of this package, or not plain."""


def folder() -> Path:
    """Return the folder of the files: ``warp_torchrl/episodes`` in ``XDG_CACHE_HOME``, or in ``~/.cache``."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "warp_torchrl" / "episodes"


def cached(run_config: RunConfig, names: Sequence[str]) -> dict[str, Episodes]:
    """Return the cached episodes of heuristics, by name."""
    found = {name: _read(path) for name, path in _paths(run_config, names).items()}
    return {name: episodes for name, episodes in found.items() if episodes is not None}


def store(run_config: RunConfig, played: dict[str, Episodes]) -> None:
    """Cache episodes of heuristics; if the folder cannot be written, they are not cached."""
    for name, path in _paths(run_config, list(played)).items():
        episodes = {metric: values.tolist() for metric, values in played[name].items()}
        content = json.dumps(episodes)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            checksummed = {"sha256": sha256(content.encode()).hexdigest(), "episodes": episodes}
            disk.replace(path, json.dumps(checksummed))  # others may write the same one
        except OSError as error:
            log.debug("the baselines' episodes are not kept: %s", error)
            return


def _paths(run_config: RunConfig, names: Sequence[str]) -> dict[str, Path]:
    """Return the file of each heuristic's episodes; none where they have no digest."""
    many = run_config.evaluation.episodes > _MOST_EPISODES
    if many or run_config.plugins or not run_config.evaluation.cache:  # whose rows of tables have unknown sources
        return {}
    try:
        worlds = digest(_of_worlds(run_config))
        kinds = {name: _name_of(HEURISTICS[name]) for name in names}
        return {name: folder() / f"{digest([worlds, kind])}.json" for name, kind in kinds.items()}
    except (Unknown, OSError, RuntimeError) as reason:  # there may be no home, or no sources
        log.debug("the baselines' episodes are not kept: %s", reason)
        return {}


def _of_worlds(run_config: RunConfig) -> list[Any]:
    """Return everything that determines the episodes of all heuristics."""
    roles = [ROLES[role] for role in run_config.world.team.roles]
    abilities = [ABILITIES[name] for role in roles for name in role.abilities]
    seeds = run_config.evaluation.first_seed, run_config.evaluation.episodes
    machine = torch.device(run_config.device).type, torch.backends.cpu.get_cpu_capability(), torch.__version__
    made = run_config.world.lighting, run_config.world.air  # for this landscape
    return [run_config.world, *made, run_config.reward, roles, abilities, *seeds, *machine, code_digest()]


def digest(thing: Any) -> str:
    """Return a sha256 of components and plain values, of every field and every element.

    Raises:
        Unknown: If there is something else among them.
    """
    found = sha256()
    for part in _parts(thing):
        found.update(len(part).to_bytes(8, "big") + part)
    return found.hexdigest()


def _parts(thing: Any) -> Iterator[bytes]:
    """Yield the parts of a value, each with its kind."""
    if thing is None or isinstance(thing, bool | int | float | str | Path):
        yield f"{type(thing).__name__} {thing!r}".encode()
        yield from _of_file(thing)
    elif isinstance(thing, torch.Tensor | np.ndarray):
        array = thing.numpy(force=True) if isinstance(thing, torch.Tensor) else thing
        if array.dtype.hasobject:
            raise Unknown(f"an array of {array.dtype}")
        yield f"{array.dtype} {array.shape}".encode()
        yield np.ascontiguousarray(array).tobytes()
    elif isinstance(thing, dict):
        if any(isinstance(key, torch.device) for key in thing):
            return  # copies for devices, of what other fields hold
        yield f"dict {len(thing)}".encode()
        for key, value in thing.items():
            yield from (*_parts(key), *_parts(value))
    elif isinstance(thing, list | tuple):
        yield f"{type(thing).__name__} {len(thing)}".encode()
        for value in thing:
            yield from _parts(value)
    elif is_dataclass(thing) and not isinstance(thing, type):
        yield _name_of(type(thing)).encode()
        for each in fields(thing):
            yield from (each.name.encode(), *_parts(getattr(thing, each.name)))
    else:
        raise Unknown(f"a {type(thing).__name__}")


def _of_file(thing: Any) -> Iterator[bytes]:
    """Yield the size and time of a file that a text names, which a component may read later."""
    if isinstance(thing, str | Path) and Path(thing).suffix and os.path.isfile(thing):  # noqa: PTH113, a text may be long
        told = Path(thing).stat()
        yield f"{told.st_size} bytes of {told.st_mtime_ns}".encode()


def _name_of(kind: type) -> str:
    if not kind.__module__.startswith(_OURS):
        raise Unknown(f"{kind.__module__}.{kind.__qualname__}, whose sources are not known")
    return f"{kind.__module__}.{kind.__qualname__}"


@lru_cache(maxsize=1)
def code_digest() -> str:
    """Return a digest of the sources of the code that plays the episodes."""
    rooms = (path for room in _SOURCES for path in (_PACKAGE / room).rglob("*.py"))
    paths = sorted({*rooms, *_PACKAGE.glob("*.py")})
    return digest([[path.relative_to(_PACKAGE).as_posix(), sha256(path.read_bytes()).hexdigest()] for path in paths])


def _read(path: Path) -> Episodes | None:
    """Return the episodes in a file; None where there is none, or it is not as it was written."""
    try:
        content = foreign.read_json(path, LARGEST_EVALUATION)
        episodes = content["episodes"]
        if content["sha256"] != sha256(json.dumps(episodes).encode()).hexdigest():
            raise ValueError("its sha256 does not match")
        return {metric: np.array(values, dtype=np.float64) for metric, values in episodes.items()}
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        log.warning("%s is not used, and the baselines are played again: %s", path, " ".join(str(error).split()))
        return None
