"""What the documentation shows must run."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from warp_torchrl.runs.config.construction import COMPONENTS, component
from warp_torchrl.runs.config.defaults import defaults
from warp_torchrl.world.mechanics.table import mechanics

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PLUGINS = DOCS / "examples" / "extensions"
SITE = ROOT / ".mkdocs.yml"
PAGES = [*sorted(DOCS.glob("*.md")), ROOT / "README.md", ROOT / ".github" / "CONTRIBUTING.md"]


def blocks(page: str, language: str = "python") -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (DOCS / page).read_text(), flags=re.DOTALL)


def run(*command: str, folder: Path, timeout: float = 580, **environment: str) -> subprocess.CompletedProcess:
    """Run one of Python's modules or programs in a folder, with this project or the copy that ``PYTHONPATH`` names."""
    return subprocess.run(
        [sys.executable, *command],
        cwd=folder,
        env={**os.environ, "OMP_NUM_THREADS": "1", "NO_MKDOCS_2_WARNING": "1", **environment},
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def test_the_example_of_the_fire_alone_runs(capsys):
    example = blocks("prediction.md")[2]
    assert len(example.splitlines()) <= 30
    names: dict = {}
    exec(example, names)
    assert re.fullmatch(r"burned: \d+ ha, 5 % to 95 %: \d+ to \d+ ha\n", capsys.readouterr().out)
    probability, area = names["probability"], names["area"]
    assert probability.shape == (64, 64) and probability[32, 15] == 1.0
    assert area.shape == (64, 151) and (area.diff(dim=1) >= 0.0).all() and area[:, -1].mean() > area[:, 0].mean()


def test_the_example_of_a_prediction_runs(capsys):
    names: dict = {}
    crowns, example, _ = blocks("prediction.md")
    exec(crowns, names)
    assert capsys.readouterr().out.startswith("[0.0, 1.0, 2.0] ")
    exec(example, names)
    assert re.fullmatch(r"after an hour: \d+ ha, 5 % to 95 %: \d+ to \d+ ha\n", capsys.readouterr().out)
    assert names["prediction"].burn_probability[40, 10] == 1.0


def test_the_examples_from_python_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    training, evaluation = blocks("python.md")
    smaller = {
        "20_000": "256",
        "n_worlds=64": "n_worlds=4",
        "10_000": "128",
        "episodes=64": "episodes=2",
        "(128": "(16",
    }
    for shown, less in {**smaller, 'folder="': 'horizon=8, model=dict(actor_hidden=[8]), folder="'}.items():
        assert shown in training
        training = training.replace(shown, less)
    names: dict = {}
    exec(training, names)
    assert re.match(r"(\d+ steps: \d+% saved\n)+skirmish horizon=8: 2 fires", capsys.readouterr().out)
    assert len(names["loss"]) > 1 and names["rollout"].shape == (8, 16)
    exec(evaluation.replace("episodes=8", "episodes=2").replace('"skirmish", ', '"skirmish", horizon=16, '), names)
    assert re.fullmatch(r"\d+% saved, \d+% without a team\n", capsys.readouterr().out)


def test_the_example_of_groups_runs():
    names: dict = {}
    exec(blocks("tasks.md")[0], names)
    said = re.search(r"env.group_map  # (.*)", blocks("tasks.md")[0])[1]
    assert str(names["env"].group_map) == said


def test_the_example_of_a_live_match_runs(capsys):
    exec(blocks("live.md")[1], {})
    assert re.fullmatch(r"\d+% saved, \d+% without a team\n", capsys.readouterr().out)


def test_the_example_of_a_match_as_a_file_runs(tmp_path, monkeypatch):
    pytest.importorskip("viser", reason="needs the extra live")
    monkeypatch.chdir(tmp_path)
    exec(blocks("live.md")[0].replace("range(20)", "range(3)"), {})
    assert "<h1>default and local</h1>" in (tmp_path / "match.html").read_text()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_and_picture_of_a_page_is_there(page):
    for target in re.findall(r"\]\(([^)#]+)\)", page.read_text()):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", sorted(DOCS.glob("*.md")), ids=lambda page: page.name)
def test_a_page_links_to_nothing_outside_of_the_site(page):
    assert not re.findall(r"\]\((\.\.[^)]*)\)", page.read_text()), "such a link works on GitHub alone"


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text().split()) <= 900


def test_the_documentation_is_short():
    pages = list(DOCS.glob("*.md"))
    assert len(pages) <= 20
    assert sum(len(page.read_text().split()) for page in pages) <= 30_000


# The site


def test_every_page_is_in_the_navigation():
    navigation = SITE.read_text().partition("\nnav:\n")[2].partition("\n\n")[0]
    assert sorted(re.findall(r": (\S+\.md)", navigation)) == sorted(page.name for page in DOCS.glob("*.md"))


@pytest.mark.slow
def test_the_site_builds_without_warnings(tmp_path):  # .ci/run builds it too
    pytest.importorskip("material", reason="the site needs the extra docs")
    pytest.importorskip("mkdocstrings", reason="the site needs the extra docs")
    done = run("-m", "mkdocs", "build", "--strict", "-f", str(SITE), "-d", str(tmp_path / "site"), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    built = {path.stem for path in (tmp_path / "site").glob("*.html")}
    assert built >= {page.stem for page in DOCS.glob("*.md")}
    assert 'id="warp_torchrl.api.make.make_env"' in (tmp_path / "site" / "api.html").read_text()
    assert "concat_vec_envs_v1" in (tmp_path / "site" / "interop.html").read_text(), "the examples stand in the page"


# The page of keys


def test_the_page_of_keys_has_each_key_of_each_component_with_its_default_and_words(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS))
    from drawings import keys

    page = keys.on_page_markdown((DOCS / "keys.md").read_text())
    rows = set(re.findall(r"(?m)^\| `([\w.]+)` \| (?:`.*`)? \| \S.* \|$", page))
    assert page.count("\n| `") == len(re.findall(r"(?m)^\| `[\w.]+` \| (?:`.*`)? \| \S.* \|$", page)), "words for each"
    files = [path for group in COMPONENTS for path in (ROOT / "conf" / group).glob("*.yaml")]
    for path in files:
        kind = component(yaml.safe_load(path.read_text())["_target_"])
        assert {f"{path.parent.name}.{name}" for name in flat(defaults(kind))} <= rows, path
        assert f"`{path.parent.name}={path.stem}`" in page
    assert {f"mechanics.{name}.{key}" for name, kind in mechanics().items() for key in flat(defaults(kind))} <= rows
    assert {"n_worlds", "checkpoint.minutes", "imitation.teacher", "steps_per_tick", "search.trials", "fires"} <= rows
    assert (
        "| `seed` | `0` |" in page and "| `steps_per_tick` | `5` | Agent steps to a fire tick. In 1 .. 1000. |" in page
    )


def flat(values: dict, prefix: str = "") -> list[str]:
    """Names of values, those of nested mappings after dots."""
    return [
        name
        for key, value in values.items()
        for name in (flat(value, f"{prefix}{key}.") if isinstance(value, dict) and value else [f"{prefix}{key}"])
    ]


# What is TorchRL's


def test_what_the_table_says_is_torchrls_is_used_from_there():
    section = (DOCS / "interop.md").read_text().partition("## What is TorchRL's")[2].partition("\n## ")[0]
    theirs = [row.split(" | ")[1] for row in section.splitlines() if row.startswith("| ")][1:]
    said = {name for cell in theirs for name in re.findall(r"`(\w+)`", cell)} - {"state_dict"}
    code = "\n".join(path.read_text() for path in (ROOT / "warp_torchrl").rglob("*.py"))
    imports = re.findall(r"^from torchrl\S* import (?:\(([^)]*)\)|(.*))$", code, flags=re.MULTILINE)
    assert len(said) > 15 and said <= set(re.findall(r"\w+", str(imports)))


# The tutorial


SMALL = {
    r"total_frames=\S+": "total_frames=64 n_worlds=4 collector.steps=8 algorithm.minibatch_size=16",
    r" n_worlds=64": "",
    r"experiment=quick": "experiment=quick collector.first_steps=8",
    r"evaluation\.episodes=\S+": "evaluation.episodes=3 horizon=16",
}


@pytest.mark.slow
def test_the_tutorial_runs_from_its_first_command_to_its_last(tmp_path, monkeypatch, capsys):
    for program in ("train.py", "evaluate.py"):
        shutil.copy(ROOT / program, tmp_path)
    commands = [line for block in blocks("tutorial.md", "bash") for line in block.replace("\\\n", "").splitlines()]
    commands = [line for line in commands if re.match(r"python (train|evaluate)\.py ", line)]
    for line in commands:
        for pattern, smaller in SMALL.items():
            line = re.sub(pattern, smaller, line)
        done = run(*shlex.split(line)[1:], folder=tmp_path)
        is_mistake = line.endswith("team.n_agents=0")
        assert done.returncode == (2 if is_mistake else 0), f"{line}\n{done.stderr}"
        assert not is_mistake or done.stderr.splitlines()[-1] in (DOCS / "tutorial.md").read_text()
    assert (tmp_path / "outputs" / "sweep" / "summary.md").exists() and len(commands) > 7
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for block in blocks("tutorial.md"):
        exec(block, names)
    first, second = capsys.readouterr().out.splitlines()
    assert re.fullmatch(r"\d+ episodes, \d+% of the trees saved", first)
    assert re.fullmatch(r"\d+% of the trees saved", second)


# Interop


def test_every_example_is_shown_and_linked_once():
    page = (DOCS / "interop.md").read_text()
    examples = sorted(path.name for path in (DOCS / "examples").glob("*.py"))
    assert sorted(re.findall(r'--8<-- "examples/(\S+)"', page)) == examples
    assert sorted(re.findall(r"\]\(examples/(\S+)\)", page)) == examples


def test_the_views_of_pettingzoo_and_gymnasium_are_as_shown(capsys):
    names: dict = {}
    for block in blocks("interop.md")[:2]:
        exec(block, names)
    assert re.fullmatch(r"\d+% of the trees saved\n", capsys.readouterr().out)
    assert names["central"].shape == (8, 16, 16) and names["frame"].dtype == "uint8"
    assert names["rewards"].shape == (64,) and names["infos"]["saved"].shape == (64,)


# Extending


@pytest.fixture(scope="module")
def extended(tmp_path_factory):
    """A copy of the project with the files that docs/extending.md shows."""
    copy = tmp_path_factory.mktemp("extended")
    for folder in ("warp_torchrl", "conf", "tests", "docs/policies"):
        shutil.copytree(ROOT / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", copy)
    page = re.sub(r'--8<-- "(\S+)"\n', lambda shown: (DOCS / shown[1]).read_text(), (DOCS / "extending.md").read_text())
    files = re.findall(r'```[^\n]* title="(\S+)"[^\n]*\n(.*?)```', page, flags=re.DOTALL)
    for path, text in files:
        assert not (copy / path).exists(), "an extension changes no file that is there"
        (copy / path).parent.mkdir(exist_ok=True)
        (copy / path).write_text(text)
    return copy, [path for path, _ in files]


def test_an_extension_is_one_module_one_yaml_and_one_test(extended):
    _, files = extended
    assert [Path(path).parts[0] for path in files] == ["warp_torchrl", "conf", "tests"] * 3


@pytest.mark.slow
def test_the_extensions_keep_to_their_own_tests_and_the_configuration_s(extended):
    copy, files = extended
    tests = [path for path in files if path.startswith("tests/")]
    passes(copy, *tests, "tests/runs/config/test_conf.py")


@pytest.mark.slow
def test_the_extensions_keep_to_what_is_asked_of_all(extended):
    passes(extended[0], "tests/algorithms/test_every_algorithm.py", "tests/test_architecture.py")


def test_the_extensions_are_written_as_the_rest_is(extended):
    pytest.importorskip("ruff", reason="needs the extra dev")
    copy, files = extended
    modules = [path for path in files if path.endswith(".py")]
    for check in (("check", "--no-cache"), ("format", "--check", "--no-cache")):
        done = run("-m", "ruff", *check, *modules, folder=copy)
        assert done.returncode == 0, done.stdout


def test_every_plug_in_is_listed_with_its_option_and_has_a_test():
    page = (DOCS / "extending.md").read_text()
    listed = re.findall(r"\]\(examples/extensions/(\w+)\.py\) \| `warp train plugins=\[(\w+)\] (\w+=\w+)", page)
    assert all(file == module for file, module, _ in listed)
    assert sorted([*(f"{file}.py" for file, _, _ in listed), *(f"test_{file}.py" for file, _, _ in listed)]) == sorted(
        path.name for path in PLUGINS.glob("*.py") if path.name != "conftest.py"
    )
    for file, _, option in listed:
        assert option in (PLUGINS / f"{file}.py").read_text()


@pytest.mark.slow
def test_the_plug_ins_of_extensions_keep_to_their_own_tests():
    done = run("-m", "pytest", "-o", "addopts=", "-p", "no:cacheprovider", ".", folder=PLUGINS, PYTHONPATH=f"{ROOT}:.")
    assert done.returncode == 0, done.stdout
    assert re.search(r"\b17 passed", done.stdout)


def passes(copy: Path, *tests: str) -> None:
    new = ["-k", "alight or surrogate or showers"]
    done = run("-m", "pytest", "-n", "0", "-p", "no:cacheprovider", *tests, *new, folder=copy, PYTHONPATH=str(copy))
    assert done.returncode == 0, done.stdout
    assert " passed" in done.stdout


# The map of the code


def test_the_map_of_the_code_has_every_room():
    page = (DOCS / "house.md").read_text()
    for folder, table in (("warp_torchrl", 0), ("warp_torchrl/world", 1)):
        named = re.findall(r"(?m)^\| `([\w.]+)` \|", page.split("| room")[table + 1])
        there = {path.name for path in (ROOT / folder).iterdir() if path.is_dir() and path.name != "__pycache__"}
        assert set(named) == there | ({"world.py"} if table else set()), folder


def test_the_glossary_is_in_order():
    glossary = (DOCS / "house.md").read_text().partition("\n## Glossary\n")[2].partition("\n## ")[0]
    terms = re.findall(r"(?m)^\| ([\w' ]+) \| ", glossary)[1:]
    assert len(terms) >= 30 and terms == sorted(terms)


def test_columns_of_metrics_are_named_as_they_are_written(weak_run):
    columns = (weak_run / "metrics.csv").read_text().splitlines()[0].split(",")
    rooms = {name.split("/")[0] for name in columns} & {"world", "rollout", "time"}
    pages = [ROOT / "README.md", *DOCS.glob("*.md")]
    named = {name for page in pages for name in re.findall(rf"`((?:{'|'.join(rooms)})/[a-z_/]+)`", page.read_text())}
    folders = {f"world/{path.name}" for path in (ROOT / "warp_torchrl/world").iterdir()}
    others = {"rollout/exploration_rate", "world/rained"}  # of DQN, and of the mechanic in extending.md
    assert "world/saved" in named and named - folders <= {*columns, *others}
