"""The card of a policy, in Markdown: its trainings, its use, its failures and its measurements."""

from collections.abc import Iterable, Mapping, Sequence

from warp_torchrl.models import Entry
from warp_torchrl.runs.checkpoint import Checkpoint
from warp_torchrl.runs.config.saved_config import SavedConfig
from warp_torchrl.runs.history import MEAN, UNKNOWN, History, Stage, history_line
from warp_torchrl.runs.measured import Measured, Share
from warp_torchrl.system.foreign_text import plain_text

CARD = "README.md"
"""Name of the card in a policy's folder, which repositories show first."""


def card(found: Checkpoint, name: str) -> str:
    """Return the card of a policy.

    Args:
        found: The checkpoint.
        name: Name of the policy.
    """
    saved = found.saved_config()
    parts = [
        f"# {_plain(name)}",
        "The policy of a team of simulated fire-fighting vehicles. Each vehicle acts on its own observation and mask.",
        *_what(found, saved),
        "## Training",
        *_training(found.history),
        "## Use",
        *_use(found, saved),
        "## Where it fails",
        *_failures(found, saved),
        "## Measured",
        *_measurements(found.manifest.measured),
    ]
    return "\n".join(["\n\n".join(parts), ""])


def _what(found: Checkpoint, saved: SavedConfig) -> list[str]:
    of, model = found.manifest, saved.values.get("model", {})
    seen = ", ".join(
        f"{_code(name or 'observation')} {_shape(entry)}" for name, entry in of.signature.observation.items()
    )
    rows = {
        "last trained on": _code(found.history[-1].worlds),
        "observes": seen,
        "chooses among": ", ".join(map(_code, of.signature.actions)),
        "networks": f"{_code(saved.choices.get('model', ''))}, hidden layers {model.get('actor_hidden')}, "
        f"{sum(each.numel() for each in found.policy().values()):,} parameters",
        "acts": f"{of.mode or 'sampled'}",
        "weights": f"sha256 {_code(of.files[found.weights]['sha256'])}",
    }
    return [_table(("", ""), rows.items())]


def _shape(entry: Entry) -> str:
    return f"{_plain(entry.dtype)} {list(entry.shape)}"


def _training(history: History) -> list[str]:
    """Return the history of a policy: its sum, and a row for each stage."""
    number = {stage.key: str(at) for at, stage in enumerate(history, 1)}
    rows = [
        (
            number[stage.key],
            _code(stage.worlds),
            "mean of parameters" if stage.algorithm == MEAN else f"{stage.steps:,}",
            "" if stage.algorithm == MEAN else _code(stage.algorithm),
            _from(stage, number),
            ", ".join(_code(each.name) + (f" ({each.steps:,} steps)" if each.steps else "") for each in stage.teachers),
            _code(stage.adviser or ""),
        )
        for stage in history
    ]
    titles = ("", "worlds", "world steps", "algorithm", "begins with", "teachers", "adviser")
    return [f"{_plain(history_line(history))}.".capitalize(), _table(titles, rows)]


def _from(stage: Stage, number: Mapping[str, str]) -> str:
    if not stage.parents:
        return "new networks"
    return " and ".join("a policy without a record" if each == UNKNOWN else number[each] for each in stage.parents)


def _use(found: Checkpoint, saved: SavedConfig) -> list[str]:
    """Return what the policy may be used for, and what it needs."""
    of, adviser = found.manifest.signature, found.history[-1].adviser
    model = saved.values.get("model", {})
    lines = ["Research on teams in simulated fires. It is no forecast and no order: nobody should act on it at a fire."]
    lines.append(f"Roles: {', '.join(map(_code, of.roles))}; actions and channels of a world are matched by name.")
    if adviser:
        lines.append(
            f"Each step the baseline {_code(adviser)} must advise every vehicle. It reads the whole map, so the team "
            "is no more decentralised than its adviser."
        )
    if model.get("messages") in ("graph", "both"):
        lines.append("Its agents exchange messages by radio each step.")
    if model.get("memory"):
        lines.append("Its agents remember: one state for each vehicle, which begins with the episode.")
    if model.get("sharing") == "none":
        lines.append(f"It has a network for each agent: teams of {of.n_agents} alone.")
    return [_listed(lines)]


def _failures(found: Checkpoint, saved: SavedConfig) -> list[str]:
    """Return where the policy is measured to be behind a baseline, and what its observation does not tell."""
    observation = saved.values.get("observation", {})
    behind = [(each, name, gap) for each in found.manifest.measured for name, gap in each.differences.items()]
    lines = [
        f"Behind the baseline {_code(name)} on {_code(each.worlds)}: {_points(gap)} points."
        for each, name, gap in behind
        if gap.high < 0.0
    ]
    if not observation.get("rules"):
        lines.append(
            "It does not observe the rules of the world: other fires, tanks, speeds or map sizes are new to it."
        )
    if not observation.get("water"):
        lines.append("It does not observe the way to water.")
    lines.append("It does not observe the width of its cells.")
    if not found.manifest.measured:
        lines.append("No evaluation is on record: where else it fails is not known.")
    return [_listed(lines)]


def _measurements(measured: Sequence[Measured]) -> list[str]:
    """Return the table of results, and how they were measured."""
    if not measured:
        return ["No evaluation is on record. `python evaluate.py checkpoint=POLICY` makes one."]
    beside = list(dict.fromkeys(name for each in measured for name in each.differences))
    rows = [
        (
            _code(each.worlds),
            f"{each.fires} from {each.first_seed}",
            each.metric,
            f"{100.0 * each.reached.mean:.1f} ({100.0 * each.reached.low:.1f} .. {100.0 * each.reached.high:.1f})",
            *(_points(each.differences[name]) if name in each.differences else "" for name in beside),
        )
        for each in measured
    ]
    titles = ("worlds", "fires, seeds", "metric", "in %", *(f"to {_code(name)}" for name in beside))
    how = (
        "Means over fires that no training has, with 95 % bootstrap intervals, by `python evaluate.py "
        "checkpoint=POLICY scenario=WORLDS`. Differences to baselines are paired by fire, in points. `saved`: trees "
        "that neither burned nor were cleared; `watched`: front of the fire in sight."
    )
    return [how, _table(titles, rows)]


def _points(gap: Share) -> str:
    return f"{100.0 * gap.mean:+.1f} ({100.0 * gap.low:+.1f} .. {100.0 * gap.high:+.1f})"


def _table(titles: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [titles, ["---"] * len(titles), *rows]
    return "\n".join(f"| {' | '.join(each)} |" for each in lines)


def _listed(lines: Sequence[str]) -> str:
    return "\n".join(f"- {each}" for each in lines)


def _plain(text: str) -> str:
    """Return a text of a stranger without markup."""
    return " ".join(plain_text(text).translate({ord(mark): " " for mark in "`|<>[]*#\\"}).split())


def _code(text: str) -> str:
    return f"`{_plain(text)}`" if text else ""
