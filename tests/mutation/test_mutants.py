"""The sample of mutants: reproducible, evenly spread, and honest about what survives."""

import json
import tomllib

import pytest

from tests.mutation import __main__ as command
from tests.mutation.mutants import HERE, ROOT, Mutant, accepted, beside, drawn, places, plan, sample
from tests.mutation.runner import KILLED, SURVIVED, TOO_LONG, Run, run, verdict
from tests.world.mechanics.there import needs

MODULE = "warp_torchrl/world/law/law.py"


def test_every_accepted_mutant_stands_in_the_code_with_a_reason():
    entries = tomllib.loads((HERE / "accepted.toml").read_text())["mutant"]
    assert len(accepted()) == len(entries), "an entry stands there twice"
    for each in entries:
        lines = [line.strip() for line in (ROOT / each["module"]).read_text().splitlines()]
        assert each["before"] in lines and each["before"] != each["after"] and len(each["reason"]) > 10, each


@needs("agencies", "retardant", "sensing")
def test_the_plan_names_what_there_is():
    settings = plan()
    for pattern in settings["subjects"].values():
        modules = [path.relative_to(ROOT).as_posix() for path in ROOT.glob(pattern)]
        assert modules, pattern
        for module in modules:
            tests = beside(module, settings["tests"])
            assert all((ROOT / each).exists() for each in tests), module
            assert "tests" not in tests, f"{module} has the whole suite beside it: name its tests in plan.toml"
    assert all((ROOT / "warp_torchrl" / f"{module}.py").exists() for module in settings["tests"])


def test_every_module_of_every_room_is_of_a_subject():
    planned = {path for pattern in plan()["subjects"].values() for path in ROOT.glob(pattern)}
    left_out = set(ROOT.glob("warp_torchrl/**/*.py")) - planned
    assert not left_out, (
        f"plan.toml has no subject for {sorted(path.relative_to(ROOT).as_posix() for path in left_out)}"
    )


def test_a_module_s_tests_are_its_mirror_and_what_the_plan_adds():
    also = {"world/law/fire": ["tests/world/test_laws.py"]}
    assert beside("warp_torchrl/world/law/fire.py", also) == (
        "tests/world/law/test_fire.py",
        "tests/world/test_laws.py",
    )
    assert beside("warp_torchrl/evaluation/statistics.py", also) == ("tests/evaluation/test_statistics.py",)
    assert beside("warp_torchrl/algorithms/replay.py", also) == ("tests/algorithms",)


def test_a_mutant_is_one_line_of_python_that_means_something_else():
    pytest.importorskip("cosmic_ray")
    source = (ROOT / MODULE).read_text().splitlines()
    found = drawn(places(MODULE), 12, seed=1)
    assert len(found) == 12 and found == drawn(places(MODULE), 12, seed=1) != drawn(places(MODULE), 12, seed=2)
    for each in found:
        changed = each.source.splitlines()
        assert source[each.line - 1].strip() == each.before != each.after
        assert len(changed) == len(source) and changed[: each.line - 1] == source[: each.line - 1]
        assert "def " not in each.before and "Tensor" not in each.before  # no types, which nothing computes


def test_mutants_lie_a_step_apart():
    # 4 of n places: each quarter of the code has one, or the next that can be mutated.
    pytest.importorskip("cosmic_ray")
    found = places(MODULE)
    quarters = [[place.start[0] for place in found][round(part * len(found) / 4)] for part in range(4)]
    lines = [each.line for each in drawn(found, 4, seed=0)]
    assert lines == sorted(lines) and all(line >= quarter for line, quarter in zip(lines, quarters, strict=True))


def test_subjects_have_equal_shares():
    pytest.importorskip("cosmic_ray")
    found = sample({"a": MODULE, "b": "warp_torchrl/evaluation/goal.py"}, 9, seed=0)
    assert sorted(each.module for each in found).count(MODULE) == 5 and len(found) == 9


def test_a_subject_alone_has_the_mutants_that_it_has_among_all():
    pytest.importorskip("cosmic_ray")
    subjects = {"law": MODULE, "goal": "warp_torchrl/evaluation/goal.py"}
    among_all = {each.name for each in sample(subjects, 8, seed=0)}
    alone = {each.name for each in sample(subjects, 8, seed=0, only=["goal"])}
    assert alone == {name for name in among_all if "goal.py" in name} and len(alone) == 4


def test_only_what_passes_its_tests_has_survived():
    assert Run(0, 1.0, "").verdict == Run(5, 1.0, "").verdict == SURVIVED  # 5: skipped
    assert Run(1, 1.0, "").verdict == Run(2, 1.0, "").verdict == Run(-11, 1.0, "").verdict == KILLED
    assert Run(None, 60.0, "").verdict == TOO_LONG


@pytest.mark.slow
def test_a_fault_is_killed_by_a_test_that_sees_it_and_leaves_no_trace(tmp_path):
    sound = "def double(number):\n    return number * 2\n"
    fault = Mutant("double.py", 2, "return number * 2", "return number + 2", sound.replace("*", "+"))
    (tmp_path / "double.py").write_text(sound)
    for name, number in (("sees", 3), ("blind", 2)):  # 2 + 2 is 2 x 2
        line = f"    assert double({number}) == {2 * number}\n"
        (tmp_path / f"test_{name}.py").write_text(f"from double import double\n\ndef test_{name}():\n{line}")
    assert run(tmp_path, "test_sees.py", 60.0).verdict == SURVIVED
    assert verdict(tmp_path, fault, {"test_blind.py": 60.0, "test_sees.py": 60.0}) == KILLED
    assert verdict(tmp_path, fault, {"test_blind.py": 60.0}) == SURVIVED
    assert (tmp_path / "double.py").read_text() == sound


def test_what_takes_too_long_is_ended(tmp_path):
    (tmp_path / "test_slow.py").write_text("import time\n\ndef test_slow():\n    time.sleep(60)\n")
    assert run(tmp_path, "test_slow.py", 0.5).verdict == TOO_LONG


def test_an_unexplained_survivor_fails_the_command(capsys):
    verdicts = {"a": KILLED, "b": SURVIVED, "c": SURVIVED}
    assert command._report(["a", "b", "c"], verdicts, {"c": "only its speed"}) == 1
    assert capsys.readouterr().out.splitlines() == ["3 mutants: 1 killed, 1 accepted, 1 alive", "alive: b"]
    assert command._report(["a", "c"], verdicts, {"c": "only its speed"}) == 0


def test_the_newest_verdict_of_a_mutant_counts(tmp_path):
    results = tmp_path / "results.jsonl"
    assert command._read(results) == {}
    results.write_text("".join(json.dumps({"mutant": "a", "verdict": each}) + "\n" for each in (SURVIVED, KILLED)))
    assert command._read(results) == {"a": KILLED}
