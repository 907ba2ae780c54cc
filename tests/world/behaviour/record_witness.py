"""Write down what the package pyretechnics computes for some fires: python -m tests.world.behaviour.record_witness.

It holds numpy and scipy back to old versions, so that only the extra ``witness`` installs it; the tests compare with
the file, and with the package itself where it is.
"""

import csv
import random
from pathlib import Path

from tests.world.behaviour.test_witness import DAMP, MOISTURES, witness
from warp_torchrl.benchmark.witness import crown_beds, crown_witness
from warp_torchrl.world.behaviour.standard_fuels import NOT_BURNABLE, anderson_13, scott_burgan_40

RECORD = Path(__file__).parent / "witness.csv"
CROWNS = RECORD.with_name("crown_witness.csv")
RESULTS = ("head", "direction", "length_to_breadth", "intensity", "flame_length")
CROWN_RESULTS = ("kind", "head", "intensity", "flame_length")
INPUTS = ("code", *MOISTURES, "speed", "bearing", "slope", "aspect")


def main() -> None:
    draw = random.Random(0)
    codes = {*anderson_13().codes.tolist(), *scott_burgan_40().codes.tolist()} - set(NOT_BURNABLE.values())
    with RECORD.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow((*INPUTS, *RESULTS))
        for code in sorted(codes):
            for damp in DAMP:
                speed, bearing = draw.choice((0.0, 0.5, 2.0, 5.0, 12.0)), draw.choice((0.0, 77.0, 200.0))
                slope, aspect = draw.choice((0.0, 8.0, 25.0, 40.0)), draw.choice((0.0, 130.0, 260.0))
                told = witness(code, damp, speed, bearing, slope, aspect)
                writer.writerow((code, *damp, speed, bearing, slope, aspect, *(f"{value:.6g}" for value in told)))
    with CROWNS.open("w", newline="") as file:
        beds = list(crown_beds(80))
        writer = csv.writer(file)
        writer.writerow((*beds[0], *CROWN_RESULTS))
        for bed in beds:
            given = {name: float(f"{value:.4g}") for name, value in bed.items()}
            writer.writerow((*given.values(), *(f"{value:.6g}" for value in crown_witness(given))))


if __name__ == "__main__":
    main()
