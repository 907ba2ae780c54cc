"""Formats of exported actors: ONNX, and torch's exported programs, each checked against the actor before it is kept."""

import json
import logging
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from warp_torchrl.models import Entry
from warp_torchrl.runs.checkpoint import Checkpoint, CheckpointError
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.output import draft_in, publish
from warp_torchrl.runs.policies.actor import Actor
from warp_torchrl.runs.policies.card import CARD, card
from warp_torchrl.runs.policies.described import TOLERANCE, described
from warp_torchrl.runs.policies.load import policy_of
from warp_torchrl.system import disk
from warp_torchrl.system.checksummed import first_line

DESCRIPTION = "actor.json"
"""File beside an exported actor that says what it reads and writes."""
FILES = {"onnx": "actor.onnx", "torch_export": "actor.pt2"}
"""File of each format."""
_ROWS, _OTHERS = 64, 3
"""Rows and other vehicles of the check."""
_NEEDS = ("onnx", "onnxscript", "onnxruntime")
Run = Callable[[Sequence[Tensor]], Sequence[Tensor]]
"""An exported actor: inputs to outputs, in order."""


def check_format(format: str) -> None:
    """Check that what a format needs is installed.

    Raises:
        ConfigError: If it is not.
    """
    missing = [name for name in _NEEDS if find_spec(name) is None]
    if format == "onnx" and missing:
        raise ConfigError(f'format=onnx needs {" and ".join(missing)}, not installed: pip install "warp_torchrl[onnx]"')


def export_actor(found: Checkpoint, folder: Path, format: str) -> float:
    """Write the actor of a policy, its description and its card into a new folder, which appears once all is checked.

    Args:
        found: The policy's checkpoint.
        folder: New folder.
        format: One of ``FILES``.

    Returns:
        The largest absolute difference of an output to the actor's, on random inputs.

    Raises:
        CheckpointError: If it cannot be exported, an action differs, or an output by more than ``TOLERANCE``.
        OSError: If a write fails.
    """
    actor = Actor(policy_of(found))
    with draft_in(folder.parent) as draft, disk.with_path(folder):
        path = draft / FILES[format]
        run = save_actor(actor, path, format)
        difference = check(actor, run)
        content = json.dumps(described(found, actor, path.name), indent=1)
        (draft / DESCRIPTION).write_text(content, encoding="utf-8")
        (draft / CARD).write_text(card(found, folder.name), encoding="utf-8")
        publish(draft, folder.parent, [folder.name])
    return difference


def save_actor(actor: Actor, path: Path, format: str) -> Run:
    """Write an actor in a format of ``FILES``, and return what was written, to be run.

    Raises:
        CheckpointError: If torch does not export its networks.
        OSError: If the write fails.
    """
    with _quiet():
        try:
            program = exported(actor)
            return _save_onnx(program, actor, path) if format == "onnx" else _save_program(program, path)
        except OSError:
            raise
        except Exception as error:  # torch raises many types for what it does not export
            raise CheckpointError(f"torch cannot export its networks: {first_line(error)}") from error


def exported(actor: Actor) -> torch.export.ExportedProgram:
    """Return the program of an actor, for any number of rows and of other vehicles."""
    inputs = tuple(random_inputs(actor, 5))
    actor(*inputs)  # tables that are kept between calls are made of numbers, before what is traced has none
    rows, others = torch.export.Dim("n"), torch.export.Dim("k")
    shapes = tuple({0: rows, 1: others} if name in ("radio", "messages") else {0: rows} for name in actor.reads)
    return torch.export.export(actor, inputs, dynamic_shapes=(shapes,))


def check(actor: Actor, run: Run) -> float:
    """Return the largest absolute difference of outputs to the actor's, on random inputs.

    Raises:
        CheckpointError: If an action differs, or an output by more than ``TOLERANCE``.
    """
    inputs = random_inputs(actor, _ROWS)
    expected, got = actor(*inputs), run(inputs)
    if not torch.equal(expected[0], got[0]):
        raise CheckpointError("the exported actor chooses other actions than the policy: it is not kept")
    difference = max(float((one - other).abs().max()) for one, other in zip(expected[1:], got[1:], strict=True))
    if not difference <= TOLERANCE:
        raise CheckpointError(f"the exported actor differs from the policy by {difference:g}: it is not kept")
    return difference


def random_inputs(actor: Actor, rows: int) -> list[Tensor]:
    """Return random inputs of an actor, the same at every call."""
    draws, shape = torch.Generator().manual_seed(0), actor.signature
    observed = dict(zip(actor.entries, shape.observation.values(), strict=True))
    counts = {"role": shape.n_roles, "agency": len(shape.agencies), "agent": shape.n_agents}

    def drawn(name: str) -> Tensor:
        if name in observed:
            return _drawn(observed[name], rows, draws)
        if name == "action_mask":
            mask = torch.rand(rows, shape.n_actions, generator=draws) < 0.7
            mask[:, 0] |= ~mask.any(1)
            return mask
        if name in counts:
            return torch.randint(counts[name], (rows,), generator=draws)
        sizes = {"memory": (actor.memory_size,), "messages": (_OTHERS, actor.message_size), "radio": (_OTHERS, 3)}
        numbers = torch.rand(rows, *sizes[name], generator=draws) * 2.0 - 1.0
        return numbers.round() if name == "radio" else numbers

    return [drawn(name) for name in actor.reads]


def _drawn(entry: Entry, rows: int, draws: torch.Generator) -> Tensor:
    size = (rows, *entry.shape)
    if entry.dtype == "uint8":
        return torch.randint(256, size, generator=draws, dtype=torch.uint8)
    return torch.rand(size, generator=draws).to(getattr(torch, entry.dtype))


def _save_program(program: torch.export.ExportedProgram, path: Path) -> Run:
    torch.export.save(program, path)
    return lambda inputs: program.module()(*inputs)


def _save_onnx(program: torch.export.ExportedProgram, actor: Actor, path: Path) -> Run:
    made: Any = torch.onnx.export(program, dynamo=True, verbose=False)
    graph = made.model.graph
    for place, value in enumerate(value for node in graph.all_nodes() for value in node.outputs):
        value.name = f"value_{place}"  # torch calls some of them view, as an input is called
    for value, name in (*zip(graph.inputs, actor.reads), *zip(graph.outputs, actor.writes)):
        value.name = name
    made.save(path)
    return onnx_run(path)


def onnx_run(path: Path) -> Run:
    """Return the actor in an ONNX file, run by onnxruntime on the CPU."""
    import onnxruntime

    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    names = [each.name for each in session.get_inputs()]

    def run(inputs: Sequence[Tensor]) -> list[Tensor]:
        given = {name: each.numpy() for name, each in zip(names, inputs, strict=True)}
        return [torch.from_numpy(each) for each in session.run(None, given)]

    return run


@contextmanager
def _quiet() -> Iterator[None]:
    """Let torch's exporters log errors alone: they print a line for each operator of a library that is not there."""
    logger = logging.getLogger("torch.onnx")
    before = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(before)
