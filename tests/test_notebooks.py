"""The notebooks of docs/notebooks run from their first cell to their last, on small worlds."""

import json
import os
import re
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent.parent / "docs" / "notebooks"
SMALL = {  # in place of what the cell with the tag `parameters` sets
    "fire_alone": {"size": 24, "fires": 4, "ticks": 8},
    "first_team": {"frames": 64, "worlds": 4, "fires": 2, "horizon": 8},
}
SAYS = {
    "fire_alone": [r"burned at the end: \d+ ha", r"8 m/s: \d+ ha, \d+ m to the east"],
    "first_team": [r"view +\[11, 7, 7\]", r"trained, sampled", r"\d points to coordinated"],
}


def read(name):
    return json.loads((FOLDER / f"{name}.ipynb").read_text())


def source(cell):
    return "".join(cell["source"])


def outputs(cells):
    return [output for cell in cells for output in cell.get("outputs", [])]


def test_every_notebook_is_run():
    assert {path.stem for path in FOLDER.glob("*.ipynb")} == set(SMALL)


@pytest.mark.slow
@pytest.mark.parametrize("name", SMALL)
def test_a_notebook_runs(name, tmp_path, monkeypatch):
    nbclient = pytest.importorskip("nbclient", reason="needs the extra dev")
    nbformat = pytest.importorskip("nbformat", reason="needs the extra dev")
    pytest.importorskip("matplotlib", reason="needs the extra figures")
    monkeypatch.setenv("PATH", os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]))  # warp's
    notebook = nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)
    (parameters,) = [cell for cell in notebook.cells if "parameters" in cell.metadata.get("tags", [])]
    assert set(re.findall(r"^(\w+) =", parameters.source, flags=re.MULTILINE)) == set(SMALL[name])
    parameters.source = "\n".join(f"{key} = {value}" for key, value in SMALL[name].items())
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    printed = "".join(output.get("text", "") for output in outputs(notebook.cells))
    for line in SAYS[name]:
        assert re.search(line, printed), printed


@pytest.mark.parametrize("name", SMALL)
def test_a_notebook_is_stored_small_and_without_places_of_a_machine(name):
    text = (FOLDER / f"{name}.ipynb").read_text()
    assert len(text) < 300_000
    assert not re.search(r"/(tmp|home|root|work|Users)/", text)
    assert not [output for output in outputs(read(name)["cells"]) if output["output_type"] == "error"]


@pytest.mark.parametrize("name", SMALL)
def test_the_links_and_pictures_of_a_notebook_are_there(name):
    text = "\n".join(source(cell) for cell in read(name)["cells"] if cell["cell_type"] == "markdown")
    targets = re.findall(r"\]\(([^)#]+)[^)]*\)", text)
    assert targets and all((FOLDER / target).exists() for target in targets if not target.startswith("http"))
