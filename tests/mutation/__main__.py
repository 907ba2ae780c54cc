"""Draw mutants, run the tests beside each, and fail if one lives that nobody has accepted.

    python -m tests.mutation results.jsonl              all subjects of plan.toml
    python -m tests.mutation results.jsonl rates live   the mutants of two

A line of the file is a mutant and its verdict. Those that it calls killed are not run again: after a new test, the same
command runs the survivors. Without the file all are run.
"""

import argparse
import json
import sys
import tempfile
from pathlib import Path

from tests.mutation.mutants import accepted, beside, plan, sample
from tests.mutation.runner import SURVIVED, copy_project, run, verdict


def main() -> int:
    """Run the sample and return 1 if a mutant survived that is not accepted."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path, help="file of verdicts, which is read first and added to")
    settings, reasons = plan(), accepted()
    parser.add_argument("subjects", nargs="*", help=f"of {', '.join(settings['subjects'])}; without any, all")
    given = parser.parse_args()
    if unknown := set(given.subjects) - settings["subjects"].keys():
        parser.error(f"subjects must be of {', '.join(settings['subjects'])}, got {', '.join(sorted(unknown))}")
    results = given.results
    mutants = sample(settings["subjects"], settings["count"], settings["seed"], given.subjects)
    verdicts = _read(results)
    with tempfile.TemporaryDirectory() as folder:
        copy_project(copy := Path(folder))
        limits: dict[str, float] = {}
        for number, mutant in enumerate(mutants, start=1):
            if verdicts.get(mutant.name, SURVIVED) != SURVIVED or mutant.name in reasons:
                continue
            files = (*beside(mutant.module, settings["tests"]), *settings["everywhere"])
            limits |= {file: _limit(copy, file) for file in files if file not in limits}
            found = verdicts[mutant.name] = verdict(copy, mutant, {file: limits[file] for file in files})
            with results.open("a") as file:
                file.write(json.dumps({"mutant": mutant.name, "line": mutant.line, "verdict": found}) + "\n")
            print(f"{number}/{len(mutants)} {found}: {mutant.name}", flush=True)
    return _report([mutant.name for mutant in mutants], verdicts, reasons)


def _read(results: Path) -> dict[str, str]:
    lines = results.read_text().splitlines() if results.exists() else []
    return {each["mutant"]: each["verdict"] for each in map(json.loads, lines)}


def _limit(copy: Path, file: str) -> float:
    """Return the seconds that a file of tests may take: five times as many as of the sound code, which must pass."""
    sound = run(copy, file, 1800.0)
    if sound.verdict != SURVIVED:
        sys.exit(f"{file} fails without a mutant:\n{sound.output}")
    print(f"{file}: {sound.seconds:.0f} s", flush=True)
    return max(60.0, 5.0 * sound.seconds)


def _report(names: list[str], verdicts: dict[str, str], reasons: dict[str, str]) -> int:
    named = [name for name in names if name in reasons]
    alive = [name for name in names if name not in reasons and verdicts[name] == SURVIVED]
    killed = len(names) - len(named) - len(alive)
    print(f"{len(names)} mutants: {killed} killed, {len(named)} accepted, {len(alive)} alive")
    for name in alive:
        print(f"alive: {name}")
    return 1 if alive else 0


if __name__ == "__main__":
    sys.exit(main())
