"""The description of an exported actor: what each input and output holds, for users without this project."""

from collections.abc import Sequence
from typing import Any

from warp_torchrl.entries import ADVICE
from warp_torchrl.env.observation.meanings import highs, meanings
from warp_torchrl.models import Entry
from warp_torchrl.models.trust import Trust
from warp_torchrl.runs.checkpoint import Checkpoint
from warp_torchrl.runs.config.components import build_components
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ENVIRONMENT
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.history import trained_steps
from warp_torchrl.runs.policies.actor import Actor
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.world import World

TOLERANCE = 1e-4
"""Largest absolute difference of a logit between an exported actor and the policy in float32."""
_ROWS = "n"
_OTHERS = "k"


def described(found: Checkpoint, actor: Actor, file: str) -> dict[str, Any]:
    """Return the description of an actor, as its JSON file has it.

    Args:
        found: The policy's checkpoint.
        actor: The actor.
        file: Name of the file with the exported actor.
    """
    world: World = build_components(plain(compose_config("train", [])), ENVIRONMENT)["world"]
    names = dict(zip(actor.entries, actor.signature.observation.items(), strict=True))
    observed = [_observed(given, *entry, world) for given, entry in names.items()]
    return {
        "format": 1,
        "file": file,
        "scenario": found.manifest.scenario,
        "trained_steps": trained_steps(found.history),
        "mode": found.manifest.mode,
        "tolerance": TOLERANCE,
        "inputs": [*observed, *_further(actor)],
        "outputs": _outputs(actor),
        "notes": _notes(found, actor),
    }


def _observed(given: str, name: str, entry: Entry, world: World) -> dict[str, Any]:
    known, most = meanings(name, world), highs(name)
    found = _tensor(given, [_ROWS, *entry.shape], entry.dtype, names=entry.names)
    if entry.dtype == "uint8" and set(entry.names) <= set(most):
        found["highest"] = [most[each] for each in entry.names]
    told = {each: known[each] for each in entry.names if each in known}
    return found | ({"meanings": told} if told else {})


def _further(actor: Actor) -> list[dict[str, Any]]:
    """Return the inputs beside the observation."""
    shape, memory, message = actor.signature, actor.memory_size, actor.message_size
    told = "true for each action that does something now; at least one is true"
    found = [_tensor("action_mask", [_ROWS, shape.n_actions], "bool", told, shape.actions)]
    if actor.index:
        roles = [ROLES[role].name if role in ROLES else role for role in shape.roles]
        kinds = {"role": roles, "agency": shape.agencies, "agent": list(map(str, range(shape.n_agents)))}
        told = (
            f"index of the vehicle's {actor.index}" if actor.index != "agent" else "number of the vehicle in its team"
        )
        found.append(_tensor(actor.index, [_ROWS], "int64", told, kinds[actor.index]))
    if memory:
        told = "zeros at an episode's first step, then next_memory of the vehicle's step before"
        found.append(_tensor("memory", [_ROWS, memory], "float32", told))
    if message:
        told = "of each other vehicle: 1 if it is heard, else 0; rows (south) and columns (east) to it [cells]"
        found.append(_tensor("radio", [_ROWS, _OTHERS, 3], "float32", told))
        told = "what arrives now from each other vehicle"
        found.append(_tensor("messages", [_ROWS, _OTHERS, message], "float32", told))
    return found


def _outputs(actor: Actor) -> list[dict[str, Any]]:
    shape = actor.signature
    found = [
        _tensor("action", [_ROWS], "int64", "index of the likeliest action that the mask allows", shape.actions),
        _tensor("logits", [_ROWS, shape.n_actions], "float32", "of each action, whatever the mask", shape.actions),
    ]
    if actor.memory_size:
        found.append(_tensor("next_memory", [_ROWS, actor.memory_size], "float32", "memory of the next step"))
    if actor.message_size:
        found.append(_tensor("message", [_ROWS, actor.message_size], "float32", "what the vehicle sends"))
    return found


def _notes(found: Checkpoint, actor: Actor) -> list[str]:
    notes = ["Each of the n rows is one vehicle. Maps are north up: rows grow south, columns east."]
    if found.manifest.mode == "sampled":
        notes.append("It does better with actions drawn by softmax of the logits that the mask allows.")
    advised = [
        name for entry in actor.signature.observation.values() for name in entry.names if name.startswith(ADVICE)
    ]
    trust = any(isinstance(part, Trust) for part in actor.modules())
    if advised:
        adviser = found.history[-1].adviser
        told = ", and its logit is raised" if trust else ""
        notes.append(
            f"status has advice: the action that the baseline {adviser} would choose, one-hot{told}. The baseline "
            "reads the whole map and is not in this file. Zeros are no advice, with which it was not trained."
        )
    if actor.is_late:
        notes.append("Messages arrive late: give those that were sent mechanics.radio.delay steps before.")
    elif actor.message_size:
        notes.append("Run it once for the messages of all vehicles, then again with what each of them hears.")
    return notes


def _tensor(
    name: str, shape: Sequence[int | str], dtype: str, meaning: str = "", names: Sequence[str] = ()
) -> dict[str, Any]:
    found: dict[str, Any] = {"name": name, "shape": list(shape), "dtype": dtype}
    return found | ({"meaning": meaning} if meaning else {}) | ({"names": list(names)} if names else {})
