"""Which mutants there are, and which of them are drawn: evenly spread over the code, the same for a seed."""

import ast
import random
import tomllib
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parent.parent

Position = tuple[int, int]
"""Line, from 1, and column, from 0."""


@dataclass(frozen=True)
class Mutant:
    """One line of a module, and what stands there instead."""

    module: str  # path from the root
    line: int  # from 1
    before: str  # without the white space about it
    after: str
    source: str  # the whole mutated module

    @property
    def name(self) -> str:
        """What tells it from others, also when lines are added above it."""
        return f"{self.module}: {self.before} -> {self.after}"


@dataclass(frozen=True)
class Change:
    """What a mutation operator of Cosmic Ray may do at one place: its ``occurrence``-th in the module."""

    operator: str
    occurrence: int


@dataclass(frozen=True)
class Place:
    """An operator, number, keyword or decorator of a module, and what may become of it."""

    module: str
    start: Position
    changes: tuple[Change, ...]


def plan() -> dict:
    return tomllib.loads((HERE / "plan.toml").read_text())


def beside(module: str, also: dict[str, list[str]]) -> tuple[str, ...]:
    """Return the tests beside a module: those of its mirror in ``tests`` and those that the plan adds."""
    path = Path(module).relative_to("warp_torchrl").with_suffix("")
    mirror = Path("tests") / path.parent / f"test_{path.name}.py"
    named = [mirror.as_posix()] * (ROOT / mirror).exists() + also.get(path.as_posix(), [])
    folders = [Path("tests") / each for each in path.parents]
    package = next(each for each in folders if (ROOT / each).exists())
    return tuple(dict.fromkeys(named)) or (package.as_posix(),)


def annotations(source: str) -> list[tuple[Position, Position]]:
    """Return where types stand, which nothing computes."""
    found = []
    for node in ast.walk(ast.parse(source)):
        for child in (getattr(node, "annotation", None), getattr(node, "returns", None)):
            if child is not None:
                found.append(((child.lineno, child.col_offset), (child.end_lineno, child.end_col_offset)))
    return found


def places(module: str) -> list[Place]:
    """Return the places of a module that can be mutated, in the order of its text."""
    source = (ROOT / module).read_text()
    types = annotations(source)
    found: dict[Position, list[Change]] = {}
    for operator, occurrence, start in _positions(source):
        if not any(first <= start < last for first, last in types):
            found.setdefault(start, []).append(Change(operator, occurrence))
    return [Place(module, start, tuple(found[start])) for start in sorted(found)]


def mutant(place: Place, draws: random.Random) -> Mutant | None:
    """Return a mutant of a place, or None where every change is none or no Python."""
    source = (ROOT / place.module).read_text()
    meaning = ast.dump(ast.parse(source))
    for change in draws.sample(place.changes, len(place.changes)):
        changed = _mutated(source, change)
        try:
            differs = ast.dump(ast.parse(changed)) != meaning and compile(changed, place.module, "exec")
        except SyntaxError:
            continue
        if differs:
            line = place.start[0]
            before, after = (each.splitlines()[line - 1].strip() for each in (source, changed))
            return Mutant(place.module, line, before, after, changed)
    return None


def drawn(all_places: list[Place], count: int, seed: int) -> list[Mutant]:
    """Return so many mutants, a step apart from a random start, so that every part of the code has its share."""
    draws, step = random.Random(seed), len(all_places) / count
    first = draws.random() * step
    found: list[Mutant] = []
    for number in range(count):
        index = int(first + number * step)
        picked = next(filter(None, (mutant(place, draws) for place in all_places[index:])), None)
        found += [picked] if picked else []
    return found


def sample(subjects: dict[str, str], count: int, seed: int, only: Collection[str] = ()) -> list[Mutant]:
    """Return mutants in equal shares of the subjects, in random order: a part of them is a sample too.

    Args:
        subjects: Patterns of their modules, by name.
        count: Mutants of all subjects.
        seed: Of what is drawn.
        only: Subjects whose mutants are returned; none for all. They are the same as among all.
    """
    found: list[Mutant] = []
    for number, (name, pattern) in enumerate(subjects.items()):
        if only and name not in only:
            continue
        modules = sorted(path.relative_to(ROOT).as_posix() for path in ROOT.glob(pattern))
        share = count // len(subjects) + (number < count % len(subjects))
        found += drawn([place for module in modules for place in places(module)], share, seed)
    unique = list({each.name: each for each in found}.values())
    random.Random(seed).shuffle(unique)
    return unique


def accepted() -> dict[str, str]:
    """Return the reasons of the mutants that may live, by name."""
    entries: Iterable[dict[str, str]] = tomllib.loads((HERE / "accepted.toml").read_text()).get("mutant", ())
    return {f"{each['module']}: {each['before']} -> {each['after']}": each["reason"] for each in entries}


def _positions(source: str) -> Iterator[tuple[str, int, Position]]:
    from cosmic_ray.ast import ast_nodes, get_ast

    nodes = list(ast_nodes(get_ast(source)))
    for name, operator in _operators().items():
        spans = (span for node in nodes for span in operator.mutation_positions(node))
        for occurrence, (start, _) in enumerate(spans):
            yield name, occurrence, start


def _mutated(source: str, change: Change) -> str:
    """Return the changed source, with an empty line for each that is taken away, so that lines keep their numbers."""
    from cosmic_ray.mutating import mutate_code

    before = source.splitlines(keepends=True)
    after = mutate_code(source, _operators()[change.operator], change.occurrence).splitlines(keepends=True)
    if missing := len(before) - len(after):  # a decorator goes with the empty lines above it
        at = next(number for number, (old, new) in enumerate(zip(before, after)) if old != new)
        after[at:at] = missing * ["\n"]
    return "".join(after)


@cache
def _operators() -> dict:
    """Return Cosmic Ray's operators that need no arguments and change the meaning, not the type."""
    from cosmic_ray.plugins import get_operator, operator_names

    kinds = {name: get_operator(name) for name in operator_names() if _keeps_the_type(name)}
    return {name: kind() for name, kind in kinds.items() if not kind.arguments()}


def _keeps_the_type(operator: str) -> bool:
    """Return whether what an operator of Cosmic Ray puts in a place may stand there: ``-`` for ``+``, not ``<<``."""
    if "Replace" not in operator or "Operator_" not in operator:
        return True
    old, new = operator.split("_")[-2:]
    return old == "Delete" or any({old, new} <= set(family.split()) for family in _FAMILIES)


_FAMILIES = ("Add Sub Mul Div FloorDiv Mod Pow", "BitAnd BitOr BitXor", "Lt LtE Gt GtE", "Eq NotEq", "Is IsNot")
