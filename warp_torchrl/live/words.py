"""Texts of the page: tables and short lines as Markdown, bars and the legend as HTML.

Names of recordings, policies, scenarios, vehicles and actions come from outside. All are escaped here.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from warp_torchrl.demonstrations.summary import Summary
from warp_torchrl.env.pictures.colours import legend_colours
from warp_torchrl.env.pictures.veil import can_believe, veil_colours
from warp_torchrl.live.crew import Question
from warp_torchrl.live.drawing import VEHICLE_COLOURS
from warp_torchrl.live.match import Match
from warp_torchrl.live.side import Side
from warp_torchrl.system.foreign_text import escaped_markdown as escaped
from warp_torchrl.system.foreign_text import plain_text

_LISTED = 15  # recordings on the page
_GAP, _NO_BREAK = "\u2003", "\u00a0"  # the page's tables have no room between columns of their own
_STYLE = "font-family:inherit;font-size:12px;line-height:1.35"


def headline(match: Match) -> str:
    """Return the scenario, the policies and the progress of a match."""
    step, horizon = int(match.alone.state.step[0]), match.world.horizon
    step = max(step, *(int(side.state.step[0]) for side in match.sides))
    end = ", over" if match.ended else ""
    return f"**{escaped(match.scenario)}**, seed {match.setting.seed}: step {step} of {horizon}{end}"


def numbers_table(match: Match) -> str:
    """Return the table of all sides: forest saved and burning, acts."""
    rows = [f"| | {_heads('saved', 'burning', 'put out', 'cleared')} |", "|---|---:|---:|---:|---:|"]
    for side in match.everywhere:
        curves = side.curves
        acts = f"{int(curves.extinguished.sum())} | {int(curves.cleared.sum())}" if side is not match.alone else " | "
        rows.append(f"| {escaped(title(side))} | **{curves.saved[-1]:.1%}** | {curves.burning[-1]:.1%} | {acts} |")
    return "\n".join(rows)


def _heads(*names: str) -> str:
    """Return the heads of columns of numbers, apart and in one line."""
    return " | ".join(f"{_GAP}{name.replace(' ', _NO_BREAK)}" for name in names)


def title(side: Side) -> str:
    """Return the short name of a side's policy, as plain text; of a run also its training steps."""
    name, frames = plain_text(side.player.name), side.player.frames
    short = name if len(name) <= 26 else f"...{name[-23:]}"
    return short if frames is None else f"{short} ({frames / 1e6:.1f} M)"


def labels(names: Sequence[str]) -> list[str]:
    """Return short names of vehicles, which stand apart where they are close: ``B0`` of ``bulldozer_0``."""
    stems = {name.rpartition("_")[0].capitalize() for name in names}
    letters = next(count for count in range(1, 100) if len({stem[:count] for stem in stems}) == len(stems))
    return [stem.capitalize()[:letters] + number for stem, _, number in (name.rpartition("_") for name in names)]


def so_far(side: Side) -> str:
    """Return how much was played, and how much of it by people."""
    open_recording = side.open_recording
    corrections = f"{open_recording.corrections} of them corrections" if open_recording.acts else "no corrections"
    return f"**{len(open_recording.rows)}** steps so far, **{open_recording.acts}** acts of people, {corrections}."


def recordings(folder: Path, found: Mapping[str, Summary | str], left_out: int = 0) -> str:
    """Return the table of the recordings in a folder, the newest of them last.

    Args:
        folder: Their folder.
        found: Their numbers, or why one is broken, by name.
        left_out: How many are not shown for their names.
    """
    others = f"\n\n{left_out} left out: names have letters, digits, ., \\_ and - alone." if left_out else ""
    if not found:
        return f"**{escaped(folder)}** holds no recording.{others}"
    rows = [
        f"In **{escaped(folder)}**:",
        "",
        "| recording | steps | acts | corrections | saved |",
        "|---|---:|---:|---:|---:|",
    ]
    for name, each in list(found.items())[-_LISTED:]:
        if isinstance(each, str):
            rows.append(f"| {escaped(name)} | broken | | | |")
            continue
        saved = "" if each.saved is None else f"{each.saved:.0%}"
        rows.append(f"| {escaped(name)} | {each.steps} | {each.acts} | {each.corrections} | {saved} |")
    if len(found) > _LISTED:
        rows.append(f"\nand {len(found) - _LISTED} before them.")
    return "\n".join(rows) + others


def training(told: str, newest: int | None) -> str:
    """Return how far a training is, and whether there is a policy to play."""
    ready = "" if newest is None else f" A policy of {newest:,} steps can be played."
    return f"{escaped(told)}.{ready}" if told else "Only policies that were trained by mappo, ippo, ppo or a2c learn."


def acts(side: Side) -> str:
    """Return the table of a team's vehicles: the mover of each, its water, and its acts."""
    curves, tank = side.curves, side.state.vehicles.tank[0].tolist()
    full = side.env.world.team.tank
    rows = [f"| vehicle | moved by | {_heads('put out', 'cleared', 'water')} |", "|---|---|---:|---:|---:|"]
    for agent, name in enumerate(side.env.agent_names):
        water = "" if full is None else f"{tank[agent]} of {full}"
        done = f"{int(curves.extinguished[agent])} | {int(curves.cleared[agent])}"
        rows.append(f"| {escaped(name)}{_GAP} | {moved_by(side, agent)} | {done} | {water} |")
    return "\n".join(rows)


def moved_by(side: Side, agent: int, person: int | None = None) -> str:
    """Return the mover of a vehicle, as ``person`` reads it; None is no particular person."""
    seat = side.crew.seats[agent]
    if seat.person is not None:
        return "you" if seat.person == person else "a person"
    if seat.order is None:
        return "policy"
    return f"policy, sent to {seat.order.row}, {seat.order.column} (within {seat.order.radius})"


def questions(side: Side, asked: Sequence[Question]) -> str:
    """Return the text of the open questions; an unsure policy's also says how to answer."""
    names = [escaped(name) for name in side.env.agent_names]
    actions = [escaped(name) for name in side.env.action_names]
    lines = [
        f"**{names[each.agent]}** is about to **{actions[each.action]}**."
        if each.chance is None
        else f"What should **{names[each.agent]}** do? Its policy would **{actions[each.action]}**; its likeliest "
        f"action has {each.chance:.0%}. Press *Do it* (key G), or another action in Drive or by its key."
        for each in asked
    ]
    return "\n\n".join(lines)


def actions(side: Side, agent: int) -> str:
    """Return bars of an agent's action probabilities, with what its mask closes, as HTML."""
    mask = side.mask[agent].tolist()
    shares: Sequence[float] = [] if side.chances is None else side.chances[agent].tolist()
    last = int(side.state.vehicles.last_action[0, agent])
    rows = []
    for code, name in enumerate(side.env.action_names):
        share = shares[code] if shares else 0.0
        ink = "inherit" if mask[code] else "rgba(130,130,130,.55)"
        bar = f"<div style='background:#e8862e;height:9px;border-radius:2px;width:{100 * share:.1f}%'></div>"
        told = (f"{share:.0%}" if shares else "") if mask[code] else "closed"
        mark = " ◂ last" if code == last else ""
        rows.append(
            f"<tr style='color:{ink}'><td style='padding-right:8px'>{escaped(name)}{mark}</td>"
            f"<td style='width:45%'>{bar}</td><td style='text-align:right;padding-left:6px'>{told}</td></tr>"
        )
    note = "" if shares else "<div>This policy has no action probabilities.</div>"
    return f"<div style='{_STYLE};padding:0 12px'>{note}<table style='width:100%'>{''.join(rows)}</table></div>"


def numbers_html(numbers: Mapping[str, float]) -> str:
    """Return the numbers of an agent's observation that are not 0, as HTML."""
    rows = [f"{escaped(name)} <b>{value:.2f}</b>" for name, value in numbers.items() if abs(value) >= 0.005]
    return f"<div style='{_STYLE};padding:0 12px'>{', '.join(rows) or 'nothing else'}</div>"


def legend(side: Side) -> str:
    """Return the meaning of the colours, and the colour of each vehicle, as HTML."""
    veil = veil_colours() if can_believe(side.env.world) else {}
    drawn = legend_colours(side.env.world.buildings(side.state) is not None)
    spans = chips({**drawn, **veil, **vehicle_colours(side.env.agent_names)})
    return f"<div style='{_STYLE};padding:2px 12px'>{spans}</div>"


def vehicle_colours(names: Sequence[str]) -> dict[str, Sequence[int]]:
    """Return the colour of each vehicle by its name."""
    return {name: VEHICLE_COLOURS[at % len(VEHICLE_COLOURS)].tolist() for at, name in enumerate(names)}


def chips(colours: Mapping[str, Sequence[int]]) -> str:
    """Return colours with their names, as HTML."""
    return "".join(
        f"<span style='white-space:nowrap;margin-right:10px'><span style='display:inline-block;width:11px;height:11px;"
        f"border:1px solid #888;border-radius:2px;vertical-align:-1px;margin-right:4px;"
        f"background:rgb({red},{green},{blue})'></span>{escaped(name)}</span> "
        for name, (red, green, blue) in colours.items()
    )
