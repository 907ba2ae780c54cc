"""The power is cut before every file-system call of a prediction's end: its report is there with all maps, or not."""

import json
import shutil

import numpy as np
import pytest

from tests.stress.power import with_power_cut
from tests.world.rasters import write
from warp_torchrl.commands import predict as command
from warp_torchrl.commands.predict import OUTPUTS, REPORT
from warp_torchrl.prediction.case import read_case
from warp_torchrl.runs import output
from warp_torchrl.runs.config.options import PredictionOptions
from warp_torchrl.runs.config.prediction import compose_prediction
from warp_torchrl.runs.output import DRAFT, output_folder
from warp_torchrl.system import disk

pytestmark = pytest.mark.stress


@pytest.fixture(scope="module")
def predicted(tmp_path_factory):
    """Return a function that writes edition n of a prediction; edition 1 has an animation, which edition 2 has not."""
    folder = tmp_path_factory.mktemp("ground")
    for name, value in (("fuel", 31), ("elevation", 100)):
        write(folder / f"{name}.tif", np.full((20, 24), value), "int16", cell=50.0, crs="EPSG:32631", west=5e5)
    (folder / "weather.csv").write_text("WS,WD,FFMC\n10.8,270,90\n")
    (folder / "ignition.csv").write_text("row,column\n10,10\n")
    layers = ["landscape.fuel=fuel.tif", "landscape.elevation=elevation.tif", "landscape.table=fbp", "fire.model=fbp"]
    values = compose_prediction([f"landscape.path={folder}", *layers])
    given = {"weather": str(folder / "weather.csv"), "ignition": str(folder / "ignition.csv"), "fires": 1}
    options = {number: PredictionOptions(**given, animation=number == 1) for number in (1, 2, 3)}
    case = read_case(command._landscape(values["landscape"]), command._law(values["fire"]), options[2])
    prediction, _ = command._burn(case, options[2])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command, "write_figure", lambda *_: None)
        patch.setattr(command, "write_animation", lambda path, *_: disk.replace(path, b"GIF89a"))

        def save(out, number):
            with output_folder(out, "out", overwrite=True, last=REPORT, replaced=OUTPUTS) as draft:
                command._write(draft, prediction, case, options[number], "a fire")
                disk.replace(draft / "report.md", f"edition {number}")
                disk.replace(draft / REPORT, json.dumps({"edition": number}))

        yield save


def content(out):
    return {path.name: path.read_bytes() for path in out.iterdir() if path.is_file() and path.name != ".lock"}


def first_loss(save, folder, loses_names):
    """Cut the power before each call in turn; return the calls that were survived, and what was lost at the next."""
    whole = {}
    for number in (1, 2):
        save.good(folder / f"edition{number}", number)
        whole[number] = content(folder / f"edition{number}")
    out = folder / "out"
    for call in range(2000):
        shutil.rmtree(out, ignore_errors=True)
        shutil.copytree(folder / "edition1", out)
        returned = with_power_cut(lambda: save(out, 2), out, call, loses_names)
        there = content(out)
        if REPORT in there:
            try:
                edition = json.loads(there[REPORT])["edition"]
            except ValueError:
                return call, "a broken report"
            if there != whole[edition]:
                return call, f"edition {edition} has {sorted(there)}"
        if returned:
            return call, "" if REPORT in there and edition == 2 else "what had been written is gone"
        save.good(out, 2)
        if content(out) != whole[2] or list(out.glob(f"{DRAFT}*")):
            return call, f"the next one leaves {sorted(each.name for each in out.iterdir())}"
    raise AssertionError("it never returns")


class _Saver:
    def __init__(self, good, prepare=lambda: None):
        self.good, self._prepare = good, prepare

    def __call__(self, out, number):
        self._prepare()  # in the child alone
        self.good(out, number)


@pytest.mark.parametrize("loses_names", [False, True])
def test_no_power_cut_leaves_half_a_prediction(tmp_path, predicted, loses_names):
    survived, loss = first_loss(_Saver(predicted), tmp_path, loses_names)
    print(f"\npower cuts survived / tried: {survived + (not loss)} / {survived + 1} (names lost: {loses_names})")
    assert not loss and survived > 50, loss


def report_first():
    whole = output._fill

    def fill(folder, draft, last, replaced):
        (draft / last).replace(folder / last)
        disk.replace(draft / last, "{}")
        whole(folder, draft, "report.md", replaced)

    output._fill = fill


def test_a_writer_that_puts_the_report_first_is_found_out(tmp_path, predicted):
    assert first_loss(_Saver(predicted, report_first), tmp_path, False)[1]
