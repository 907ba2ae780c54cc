"""The floors: what may import what. Each rule is asked of all files in one test, which names those that break it."""

import ast
import re
import sys
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "warp_torchrl"
FILES = {
    path.relative_to(PACKAGE).with_suffix("").as_posix().removesuffix("/__init__"): path
    for path in PACKAGE.rglob("*.py")
}
MODULES = sorted(FILES)
GROUND = ("entries", "system", "validation")
"""What knows nothing of ours but each other, and every floor may use."""
TORCH_ALONE = ("compiler", "device", "disk", "finite", "graph", "modes", "tensors")
"""Files of ``system`` that know torch."""
FIRE_SCIENCE = ("world/behaviour", "world/weather")
"""What the world is built on: equations of fire and weather, which know torch alone."""
COMPILER = "world/arrays/compile"
"""The one module that speaks of compilers."""
FENCE = ("world/arrays", "world/backends")
"""What may read it."""
DRAWS = "world/arrays/random"
"""What a law draws with, the one way that leads from a law to the compiler."""
STATEMENTS = ("world/law/law", "world/law/travel", "world/law/arrivals", "world/law/wind_and_slope", "world/law/cells")
"""The laws in plain tensor operations, which draw nothing."""


def is_in(module: str, rooms: Iterable[str]) -> bool:
    """Whether a module is one of some folders and files."""
    return any(f"{module}/".startswith(f"{room}/") for room in rooms)


def of_rooms(*rooms: str) -> list[str]:
    """The modules of some folders and files."""
    for room in rooms:
        assert any(is_in(module, (room,)) for module in MODULES), f"no module is in {room}"
    return [module for module in MODULES if is_in(module, rooms)]


WORLD = of_rooms("world")
PICTURES = [f"env/pictures/{each}" for each in ("colours", "render", "recorder")]
READS_STATE = [*of_rooms("env/observation", "env/reward"), "env/metrics", *PICTURES, "evaluation/behaviour"]


def breaks(modules: Iterable[str], rule: Callable[[str], bool]) -> list[str]:
    """The modules that do not keep a rule."""
    return [module for module in modules if not rule(module)]


@cache
def tree(module: str) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(ast.parse(source(module))))


@cache
def source(module: str) -> str:
    return FILES[module].read_text()


@cache
def named(module: str) -> frozenset[str]:
    """Every module that a file imports."""
    found = set()
    for node in tree(module):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            within = {f"{node.module}.{alias.name}" for alias in node.names}
            are_modules = all(name.removeprefix("warp_torchrl.").replace(".", "/") in FILES for name in within)
            found |= within if are_modules else within | {node.module}
    return frozenset(found)


@cache
def roots(module: str) -> frozenset[str]:
    """The first names of what a file imports, of ours without the package's name."""
    return frozenset(name.removeprefix("warp_torchrl.").split(".")[0] for name in named(module))


@cache
def ours(module: str) -> frozenset[str]:
    own = (name for name in named(module) if name.startswith("warp_torchrl."))  # Python has a module logging too
    return frozenset({name.removeprefix("warp_torchrl.").replace(".", "/") for name in own} & set(MODULES))


@cache
def reached(module: str, *closed: str) -> frozenset[str]:
    """Every module of ours that a file imports, and that those import, to any depth, but through closed ones."""
    found, left = set(), [module]
    while left:
        new = ours(left.pop()) - found - {*closed}
        found |= new
        left += new
    return frozenset(found)


def knows_only(module: str, *rooms: str) -> bool:
    """Whether what a file imports of ours is in some rooms, is one of some files, or is of the ground."""
    return all(is_in(name, (*rooms, *GROUND)) for name in ours(module))


def test_the_world_knows_torch_and_itself():
    foreign = {"tensordict", "torchrl", "hydra", "omegaconf", "gymnasium", "pettingzoo", "wandb"}
    assert not breaks(WORLD, lambda module: knows_only(module, "world", "system/disk"))
    assert not breaks(WORLD, lambda module: not roots(module) & foreign)


def test_fire_science_knows_torch_and_itself():
    known = sys.stdlib_module_names | {"torch", "numpy", "rasterio", *GROUND, *FIRE_SCIENCE}
    assert not breaks(of_rooms(*FIRE_SCIENCE), lambda module: knows_only(module, *FIRE_SCIENCE))
    assert not breaks(of_rooms(*FIRE_SCIENCE), lambda module: roots(module) - {"world"} <= known)


def test_the_ground_floor_knows_the_standard_library_torch_and_yaml():
    known = sys.stdlib_module_names | set(GROUND)
    others = {
        **{f"system/{module}": {"torch"} for module in TORCH_ALONE},
        "system/foreign_yaml": {"yaml"},
    }
    assert not breaks(of_rooms(*GROUND), knows_only)
    assert not breaks(of_rooms(*GROUND), lambda module: roots(module) <= known | others.get(module, set()))


def test_what_reads_the_state_knows_only_the_world():
    own = ("env/observation", "env/reward", "env/pictures")
    advice = {
        f"env/observation/{each}": ("heuristics",) for each in ("advice", "ways")
    }  # which know the world alone, and act for each agent
    assert not breaks(
        READS_STATE,
        lambda module: knows_only(
            module, "world", *(room for room in own if is_in(module, (room,))), *advice.get(module, ())
        ),
    )
    assert not breaks(of_rooms("heuristics"), lambda module: knows_only(module, "world", "heuristics"))
    assert not breaks(READS_STATE, lambda module: "torchrl" not in roots(module))


def test_tensors_are_compared_with_numbers_and_not_with_members_of_enumerations():
    # Inside a function that torch compiles such a comparison is False, without a word.
    def compared_with(module: str) -> set[str]:
        each = [node for node in tree(module) if isinstance(node, ast.Compare)]
        members = [side for node in each for side in (node.left, *node.comparators) if isinstance(side, ast.Attribute)]
        return {member.value.id for member in members if isinstance(member.value, ast.Name)}

    assert not breaks(WORLD + READS_STATE, lambda module: not compared_with(module) & {"Cover", "Action", "Stream"})


def test_learning_knows_specs_and_not_the_world():
    learning = of_rooms("models", "algorithms")
    assert not breaks(learning, lambda module: knows_only(module, "models", "algorithms"))


def test_the_environment_knows_no_learning():
    assert not breaks(of_rooms("env"), lambda module: knows_only(module, "env", "heuristics", "world"))


def in_circles(modules: Iterable[str], depth: int) -> dict[str, set[str]]:
    """The rooms of some modules that import each other in a circle, and what they import.

    A room is a folder at this depth, a file above it, or a room's command.
    """
    modules = set(modules)

    def room(module: str) -> str:
        return module if module.endswith("/__main__") else "/".join(module.split("/")[:depth])

    above = {}
    for module in modules:
        above.setdefault(room(module), set()).update({room(name) for name in ours(module) & modules} - {room(module)})
    while free := [each for each, needs in above.items() if not needs & above.keys()]:
        for each in free:
            del above[each]
    return above


def test_rooms_stand_one_on_another():
    assert not in_circles(MODULES, 1)


def test_the_house_can_be_held_in_the_head():
    assert sum("/" not in path.relative_to(PACKAGE).as_posix() for path in FILES.values()) <= 6, "files in the root"
    rooms = {module: module.split("/")[0] for module in MODULES if module != "__init__"}
    arrows = {(room, rooms[name]) for module, room in rooms.items() for name in ours(module)}
    assert len(set(rooms.values())) <= 22 and len({(a, b) for a, b in arrows if a != b}) <= 106


def test_files_import_each_other_in_no_circle():
    assert not in_circles(MODULES, 99)


def test_the_rooms_of_the_world_stand_one_on_another():
    assert not in_circles(WORLD, 2)


def test_adapters_are_views_that_nothing_needs():
    adapters = of_rooms("api/adapters")
    others = [module for module in MODULES if module not in adapters]
    knows = ("__init__", "benchmark/numpy_env")  # which registers the adapters; the peer that speed is compared with
    assert not breaks(adapters, lambda module: knows_only(module, "api", "runs/config", "env")), "no physics"
    assert not breaks(others, lambda module: not any(is_in(name, ("api/adapters",)) for name in ours(module)))
    assert not breaks(others, lambda module: "pettingzoo" not in roots(module) or module in knows)


@pytest.mark.parametrize(
    "libraries, places",
    [
        (
            {"hydra", "omegaconf"},
            {
                *(
                    "runs/config/compose",
                    "runs/config/plain_values",
                    "runs/config/defaults",
                    "runs/config/files",
                    "runs/config/grammar",
                    "runs/config/plugins",
                    "runs/config/registration",
                    "runs/config/saved_config",
                    "runs/config/space",
                ),
                *("commands/checks", "commands/command", "commands/sweep"),
            },
        ),
        (
            {"rasterio"},
            {
                *("world/terrain/gdal", "world/terrain/crs", "world/terrain/resampling", "world/terrain/vector"),
                *("world/terrain/geotiff", "world/terrain/perimeter", "world/weather/convergence"),
            },
        ),
    ],
    ids=["hydra: where configuration is composed", "rasterio: where maps are read, placed and written"],
)
def test_a_library_is_imported_at_its_places_alone(libraries, places):
    assert set(breaks(MODULES, lambda module: not roots(module) & libraries)) == places


def test_nothing_reads_pickles():
    def is_safe(module: str) -> bool:
        text = source(module)
        return (
            "weights_only=False" not in text
            and "allow_pickle=True" not in text
            and "pickle" not in roots(module)
            and "_object" not in called(module)  # collectives of torch.distributed, which unpickle what they receive
            and text.count("torch.load(") == text.count("weights_only=True, map_location")
        )

    assert not breaks(MODULES, is_safe)


def called(module: str) -> str:
    """Every attribute and function that a file names, one a line."""
    return "\n".join(
        node.attr if isinstance(node, ast.Attribute) else node.id
        for node in tree(module)
        if isinstance(node, ast.Attribute | ast.Name)
    )


def test_nothing_of_ours_listens_but_the_live_page():
    """Processes of a machine inherit their sockets; ``torchrun`` has its own store, and the page a token."""
    opens = ("TCPStore", "create_server", "bind", "listen", "multiprocessing.connection", "socketserver", "http.server")
    others = [module for module in MODULES if module.split("/")[0] != "live"]
    assert not breaks(others, lambda module: not {*called(module).split(), *named(module)} & {*opens})
    assert not breaks(
        MODULES, lambda module: "init_process_group" not in called(module) or is_in(module, ("algorithms/parallel",))
    )


def is_page(module: str) -> bool:
    """Whether a module draws with viser: the page, which a browser shows, or an episode's."""
    own = ("live/episode", "live/incoming", "live/page", "live/scene", "live/screening", "live/stage")
    return module in own or module.startswith("live/panel")


def test_viser_is_imported_where_the_live_page_is_put_together():
    others = [module for module in MODULES if not is_page(module)]
    beside = [module for module in others if module.split("/")[0] == "live" and module != "commands/live"]
    assert not breaks(others, lambda module: "viser" not in roots(module))
    assert not breaks(beside, lambda module: not any(is_page(each) for each in ours(module)))


def test_one_module_speaks_of_compilers_and_the_fence_alone_reads_it():
    words = re.compile(r"is_(dynamo_)?compiling|torch\.library|torch\.ops")
    assert set(breaks(MODULES, lambda module: not words.search(source(module)))) == {COMPILER, "system/modes"}
    readers = breaks(MODULES, lambda module: COMPILER not in ours(module))
    assert readers and not breaks(readers, lambda module: is_in(module, FENCE))


def test_laws_reach_no_backend_by_any_path():
    assert len(source("world/law/law").splitlines()) <= 150
    laws = of_rooms("world/law")
    assert not breaks(laws, lambda module: not any(is_in(each, FENCE[1:]) for each in reached(module)))
    assert "world/arrays/geometry" in reached("world/law/hazard"), "the search follows several imports"


def test_a_law_reaches_the_compiler_by_its_draws_alone():
    assert not breaks(of_rooms(*STATEMENTS), lambda module: COMPILER not in reached(module))
    assert not breaks(of_rooms("world/law"), lambda module: COMPILER not in reached(module, DRAWS))
    assert COMPILER in reached("world/law/rate"), "the search follows several imports"


def test_backends_are_read_by_the_world_and_by_what_measures_and_fits_them():
    others = {"benchmark/gpu", "benchmark/ticks", "demonstrations/events"}
    others |= {"prediction/calibration/expected"}
    outside = [module for module in MODULES if not is_in(module, ("world",))]
    assert set(breaks(outside, lambda module: not any(is_in(each, FENCE[1:]) for each in ours(module)))) == others


def test_fields_are_those_of_frozen_dataclasses():
    # But for batches of tensors, which steps fill in, and learners, which hold what they train.
    mutable = {"world/arrays/batch", "algorithms/learner"}

    def unsound(module: str) -> list[str]:
        found = []
        for node in tree(module):
            if isinstance(node, ast.ClassDef) and any(isinstance(each, ast.AnnAssign) for each in node.body):
                made = [ast.unparse(each) for each in node.decorator_list]
                made = [each for each in made if each.startswith("dataclass(")]
                bases = {ast.unparse(each) for each in node.bases}
                may_change = module in mutable or bases & {"Batch", "Gains", "Terms"}
                plain = bases & {"NamedTuple", "Protocol", "TypedDict"}
                if not plain and not (made and (may_change or "frozen=True" in made[0])):
                    found.append(f"{module}: {node.name} has fields and is no frozen dataclass")
        return found

    components = [
        *of_rooms("world", "env/observation", "env/reward", "models", "algorithms", "collection"),
        "runs/checkpoint",
    ]
    assert not [fault for module in components for fault in unsound(module)]
