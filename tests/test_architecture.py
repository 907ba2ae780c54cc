"""The floors: what may import what."""

import ast
import re
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "warp_torchrl"
FILES = {
    path.relative_to(PACKAGE).with_suffix("").as_posix().removesuffix("/__init__"): path
    for path in PACKAGE.rglob("*.py")
}
MODULES = sorted(FILES)
GROUND = ("content", "device", "dotted", "nearest", "symmetry", "validation")
"""What knows nothing of ours but each other, and every floor may use."""
FIRE_SCIENCE = ("rates", "weather")
"""What the world is built on: equations of fire and weather, which know torch alone."""
READS_STATE = [
    *(each for each in MODULES if each.split("/")[0] in ("observation", "reward")),
    *("env/metrics", "env/render", "evaluation/behaviour"),
]


def named(module: str) -> set[str]:
    """Every module that a file imports."""
    found = set()
    for node in ast.walk(ast.parse(FILES[module].read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def imports(module: str) -> set[str]:
    """The same, ours without the package's name and with slashes."""
    return {name.removeprefix("warp_torchrl.").replace(".", "/") for name in named(module)}


def ours(module: str) -> set[str]:
    own = (name for name in named(module) if name.startswith("warp_torchrl."))  # Python has a module logging too
    return {name.removeprefix("warp_torchrl.").replace(".", "/") for name in own} & set(MODULES)


@pytest.mark.parametrize("module", [name for name in MODULES if name.startswith("world/")])
def test_the_world_knows_torch_and_itself(module):
    assert all(name.split("/")[0] in ("world", *FIRE_SCIENCE) or name in GROUND for name in ours(module))
    foreign = {name.split("/")[0] for name in imports(module)}
    assert not foreign & {"tensordict", "torchrl", "hydra", "omegaconf", "gymnasium", "pettingzoo", "wandb"}


@pytest.mark.parametrize("module", [name for name in MODULES if name.split("/")[0] in FIRE_SCIENCE])
def test_fire_science_knows_torch_and_itself(module):
    assert all(name.split("/")[0] in FIRE_SCIENCE or name in GROUND for name in ours(module))
    foreign = {name.split("/")[0] for name in imports(module)}
    assert foreign - set(GROUND) - set(FIRE_SCIENCE) <= sys.stdlib_module_names | {"torch", "numpy", "rasterio"}


@pytest.mark.parametrize("module", GROUND)
def test_the_ground_floor_knows_the_standard_library_and_what_a_device_is(module):
    assert all(name in GROUND for name in ours(module))
    outside = {name.split("/")[0] for name in imports(module)} - set(GROUND)
    assert outside <= sys.stdlib_module_names | ({"torch"} if module == "device" else set())


@pytest.mark.parametrize("module", READS_STATE)
def test_what_reads_the_state_knows_only_the_world(module):
    own = module.split("/")[0]
    known = {"world", *GROUND, *({own} if own in ("observation", "reward") else ())}
    assert all(name.split("/")[0] in known for name in ours(module))
    assert "torchrl" not in {name.split("/")[0] for name in imports(module)}


@pytest.mark.parametrize("module", [name for name in MODULES if name.startswith("world/")] + READS_STATE)
def test_tensors_are_compared_with_numbers_and_not_with_members_of_enumerations(module):
    # Inside a function that torch compiles such a comparison is False, without a word.
    for node in ast.walk(ast.parse(FILES[module].read_text())):
        if isinstance(node, ast.Compare):
            members = [each for each in (node.left, *node.comparators) if isinstance(each, ast.Attribute)]
            owners = {each.value.id for each in members if isinstance(each.value, ast.Name)}
            assert not owners & {"Cover", "Action", "Stream"}, f"line {node.lineno}"


@pytest.mark.parametrize("module", [name for name in MODULES if name.split("/")[0] in ("models", "algorithms")])
def test_learning_knows_specs_and_not_the_world(module):
    known = ("models", "algorithms", "parallel", *GROUND)
    assert all(name.split("/")[0] in known for name in ours(module))


@pytest.mark.parametrize("module", [each for each in MODULES if each.split("/")[0] == "env"])
def test_the_environment_knows_no_learning(module):
    assert all(name.split("/")[0] in ("env", "world", "observation", "reward", *GROUND) for name in ours(module))


@pytest.mark.parametrize("module", [each for each in MODULES if each.split("/")[0] == "maps"])
def test_maps_know_the_ground_and_neither_teams_nor_learning(module):
    known = ("maps", "drawing", "runs/disk", "world", *GROUND)
    assert all(name in known or name.split("/")[0] in known for name in ours(module) - {"runs"})


def test_rooms_stand_one_on_another():
    above = {}  # room -> rooms that it imports; a file at the root is a room of its own, and so is a room's command
    for module in MODULES:
        room = module if module.endswith("/__main__") else module.split("/")[0]
        above.setdefault(room, set()).update({name.split("/")[0] for name in ours(module)} - {room})
    while free := [room for room, needs in above.items() if not needs & above.keys()]:
        for room in free:
            del above[room]
    assert not above, "these import each other in a circle"


@pytest.mark.parametrize("module", MODULES)
def test_adapters_are_views_that_nothing_needs(module):
    if module.split("/")[0] == "adapters":
        assert all(name.split("/")[0] in ("adapters", "api", "config", "env") for name in ours(module)), (
            "no physics in adapters"
        )
    else:
        assert "adapters" not in {name.split("/")[0] for name in imports(module)}
    knows = ("__init__", "benchmark/numpy_env")  # which registers the adapters; the peer that speed is compared with
    if module.split("/")[0] != "adapters" and module not in knows:
        assert "pettingzoo" not in {name.split("/")[0] for name in imports(module)}


COMMANDS = ("commands/checks", "commands/command", "commands/sweep")


@pytest.mark.parametrize("module", MODULES)
def test_hydra_appears_only_where_configuration_is_composed(module):
    if module not in (
        "config/compose",
        "config/defaults",
        "config/grammar",
        "config/saved_config",
        "config/space",
        *COMMANDS,
    ):
        assert not {name.split("/")[0] for name in imports(module)} & {"hydra", "omegaconf"}


@pytest.mark.parametrize("module", MODULES)
def test_rasterio_is_imported_where_maps_are_read_placed_and_written(module):
    if module not in (
        "world/terrain/layer",
        "world/terrain/vector",
        "maps/geotiff",
        "maps/perimeter",
        "weather/convergence",
        "calibration/observed",
    ):
        assert "rasterio" not in {name.split("/")[0] for name in imports(module)}


@pytest.mark.parametrize("module", MODULES)
def test_nothing_reads_pickles(module):
    source = FILES[module].read_text()
    assert "weights_only=False" not in source and "allow_pickle=True" not in source
    assert "pickle" not in {name.split("/")[0] for name in imports(module)}
    assert source.count("torch.load(") == source.count("weights_only=True, map_location")


def is_page(module: str) -> bool:
    """Whether a module draws with viser: the page, which a browser shows, or an episode's."""
    own = ("live/episode", "live/page", "live/scene", "live/stage")
    return module in own or module.startswith("live/panel")


@pytest.mark.parametrize("module", MODULES)
def test_viser_is_imported_where_the_live_page_is_put_together(module):
    if not is_page(module):
        assert "viser" not in {name.split("/")[0] for name in imports(module)}
        if module.split("/")[0] == "live" and module != "live/__main__":
            assert not {each for each in ours(module) if is_page(each)}


FENCE = "world/fast"
"""Where alone words of compilers stand."""


@pytest.mark.parametrize("module", [each for each in MODULES if not each.startswith(FENCE)])
def test_compilers_are_spoken_of_behind_the_fence_alone(module):
    source = FILES[module].read_text()
    assert "is_compiling" not in source and "torch.library" not in source and "torch.ops" not in source
    assert not re.search(r'"\(.*Tensor.*\) -> ', source), "a schema of an operator"


@pytest.mark.parametrize("module", ["world/law", "world/fire"])
def test_the_page_of_the_law_takes_no_fast_road(module):
    assert len(FILES["world/law"].read_text().splitlines()) < 150
    assert not {each for each in ours(module) if each.startswith(FENCE)}


COMPONENTS = [
    each for each in MODULES if each.split("/")[0] in ("world", "observation", "reward", "models", "algorithms")
]


@pytest.mark.parametrize("module", [*COMPONENTS, "runs/checkpoint"])
def test_fields_are_those_of_frozen_dataclasses(module):
    # But for batches of tensors, which steps fill in, and learners, which hold what they train.
    mutable = {"world/batch", "world/packets", "world/state", "world/burn", "algorithms/learner"}
    for node in ast.walk(ast.parse(FILES[module].read_text())):
        if isinstance(node, ast.ClassDef) and any(isinstance(each, ast.AnnAssign) for each in node.body):
            made = [ast.unparse(each) for each in node.decorator_list if ast.unparse(each).startswith("dataclass(")]
            plain = {ast.unparse(each) for each in node.bases} & {"NamedTuple", "Protocol", "TypedDict"}
            assert plain or made, f"{node.name} has fields and is no dataclass"
            assert plain or module in mutable or "frozen=True" in made[0], f"{node.name} can be changed"
