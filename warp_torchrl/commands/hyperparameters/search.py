"""The loop of a search: starts trials, compares them while they train, prunes some, and reports results to Optuna."""

import logging
import signal
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import optuna
from optuna.trial import FrozenTrial, TrialState

from warp_torchrl.commands.hyperparameters.measures import goal_at_the_end, goal_by_share, goal_in_evaluation
from warp_torchrl.commands.hyperparameters.storage import ask, draw_values, goes_on
from warp_torchrl.evaluation.goal import SAVED
from warp_torchrl.evaluation.units import sign_of, told
from warp_torchrl.runs.checkpoint import holds_any, leave_policy
from warp_torchrl.runs.config.options import SearchOptions
from warp_torchrl.runs.config.space import Dimension, Value
from warp_torchrl.runs.process import STOPPED, SearchEnded, StartedTraining
from warp_torchrl.system.exit_codes import DISK, DONE, NUMERICAL
from warp_torchrl.system.lock import RunFolderInUse, RunFolderLock
from warp_torchrl.world.mechanics.mechanic import Metric

log = logging.getLogger("warp_torchrl")

FAILED_MOST = 3
"""So many failed trials end a search: what is wrong is wrong with all of them."""
TRIALS = "trials"
_SECONDS_OF_A_SAVE = 120.0


@dataclass(kw_only=True)
class _Running:
    """A trial that trains, once for each seed."""

    trial: optuna.Trial
    folders: list[Path]
    trainings: list[StartedTraining]
    total: int
    reported: set[int] = field(default_factory=set)
    is_pruned: bool = False

    def stop(self) -> None:
        for each in self.trainings:
            each.stop()


@dataclass(kw_only=True)
class Search:
    """A search over trainings of any kind.

    Attributes:
        study: Optuna's.
        space: Dimensions of the search.
        options: Of the search.
        folder: Folder of the search.
        start: Starts a training with these values and the number of its seed, from 0, in a run folder, and returns it;
            if the folder holds a checkpoint, it resumes from there.
        total: Returns the frames of a training with these values.
        goal: What policies of the worlds are compared by.
        after: Called after each trial that has ended.
        received: Returns the number of the signal that stops the search, 0 without one.
        seconds: Interval between two checks of the running trials [s].
    """

    study: optuna.Study
    space: Sequence[Dimension]
    options: SearchOptions
    folder: Path
    start: Callable[[Mapping[str, Value], int, Path], StartedTraining]
    total: Callable[[Mapping[str, Value]], int]
    goal: Metric = SAVED
    after: Callable[[], object] = lambda: None
    received: Callable[[], int] = lambda: 0
    seconds: float = 1.0
    failed: list[FrozenTrial] = field(default_factory=list, init=False)
    _running: list[_Running] = field(default_factory=list, init=False)

    def run(self) -> None:
        """Train until the number of trials in the options have ended; trials of an interrupted search resume first.

        Raises:
            SearchEnded: If a signal, a full disk or several failed trials ended it.
            RunFolderInUse: If a training of a former search does not end.
        """
        try:
            while True:
                self._fill()
                if not self._running:
                    return
                time.sleep(self.seconds)
                self._look()
        finally:
            self._stop()

    def _fill(self) -> None:
        """Start trials up to the number of parallel jobs, or of trials left."""
        begun = {each.trial.number for each in self._running}
        waiting = [each.number for each in self._trials(TrialState.RUNNING) if each.number not in begun]
        while len(self._running) < self.options.jobs:
            if waiting:
                self._start(goes_on(self.study, waiting.pop(0), self.space, self.options))
            elif len(self._trials(*ENDED)) + len(self._running) < self.options.trials:
                self._start(ask(self.study, self.space, self.options))
            else:
                return

    def _trials(self, *states: TrialState) -> list[FrozenTrial]:
        return self.study.get_trials(deepcopy=False, states=states)

    def _start(self, trial: optuna.Trial) -> None:
        values = draw_values(trial, self.space)
        place = self.folder / TRIALS / str(trial.number)
        seeds = range(self.options.seeds)
        folders = [place] if self.options.seeds == 1 else [place / f"seed_{seed}" for seed in seeds]
        reported = set(self.study.get_trials(deepcopy=False)[trial.number].intermediate_values)
        started = _Running(trial=trial, folders=folders, trainings=[], total=self.total(values), reported=reported)
        self._running.append(started)  # first, so that it is stopped should one of the seeds not start
        for seed, folder in enumerate(folders):
            wait_until_free(folder)
            verb = "goes on" if holds_any(folder) else "begins"
            started.trainings.append(self.start(values, seed, folder))
        told = ", ".join(f"{key}={_short(value)}" for key, value in values.items())
        log.info("trial %d %s: %s", trial.number, verb, told)

    def _look(self) -> None:
        """Check the running trials once: compare them, end some, and report ended ones to Optuna."""
        received = self.received()
        if received:
            name = signal.Signals(received).name
            raise SearchEnded(128 + received, f"stopped by signal {name}; {self._how_to_go_on()}")
        for each in list(self._running):
            codes = [training.poll() for training in each.trainings]
            self._compare(each, may_prune=None in codes)
            if None in codes:
                if any(code not in (None, DONE) for code in codes) and not each.is_pruned:
                    each.stop()  # one seed has failed
                continue
            self._running.remove(each)
            self._tell(each, [code for code in codes if code is not None])
            self._drop_training(each)
            self.after()

    def _compare(self, each: _Running, may_prune: bool) -> None:
        """Report the progress of a trial, over all its seeds, and prune it if it is not worth its time."""
        if each.is_pruned:
            return
        paths = [goal_by_share(folder / "metrics.csv", each.total, self.goal.name) for folder in each.folders]
        for share in sorted(set.intersection(*(set(path) for path in paths)) - each.reported):
            each.trial.report(sum(path[share] for path in paths) / len(paths), share)
            each.reported.add(share)
            if may_prune and each.trial.should_prune():
                each.is_pruned = True
                each.stop()
                return

    def _tell(self, each: _Running, codes: Sequence[int]) -> None:
        """Report the end of a trial to Optuna."""
        number = each.trial.number
        failed = next((place for place, code in enumerate(codes) if code not in (DONE, STOPPED)), None)
        by_evaluation = self.options.objective == "evaluation"
        if all(code == DONE for code in codes):
            values = [self._value(folder, each.total) for folder in each.folders]
            known = [value for value in values if value is not None]
            if len(known) == len(values):
                each.trial.set_user_attr("values", known)
                self.study.tell(number, sum(known) / len(known))
                log.info("trial %d: %s; %s", number, told(sum(known) / len(known), self.goal), self._so_far())
                return
            where = each.folders[values.index(None)]
            reason = f"{where} has no evaluation" if by_evaluation else f"no episode ended in the last fifth of {where}"
        elif failed is None and each.is_pruned:
            self.study.tell(number, state=TrialState.PRUNED)
            log.info("trial %d: pruned at %d %%; %s", number, max(each.reported), self._so_far())
            return
        elif failed is None:
            reason = "a signal from elsewhere stopped its training"
        else:
            reason = each.trainings[failed].reason()
            if codes[failed] == DISK:
                raise SearchEnded(DISK, f"{reason}; {self._how_to_go_on()}")
            if codes[failed] == NUMERICAL:
                each.trial.set_user_attr("reason", reason)
                self.study.tell(number, state=TrialState.PRUNED)
                log.info("trial %d: ended, %s; %s", number, reason, self._so_far())
                return
        self._fail(each, reason, 1 if failed is None else codes[failed])

    def _drop_training(self, each: _Running) -> None:
        """Keep only the policies of a trial that has ended, unless it failed."""
        state = self.study.get_trials(deepcopy=False)[each.trial.number].state
        for folder in each.folders:
            if state in ENDED and not self.options.keep_training and holds_any(folder):
                leave_policy(folder)

    def _fail(self, each: _Running, reason: str, code: int) -> None:
        each.trial.set_user_attr("reason", reason)
        self.study.tell(each.trial.number, state=TrialState.FAIL)
        self.failed.append(self.study.get_trials(deepcopy=False)[each.trial.number])
        log.warning("trial %d failed: %s", each.trial.number, reason)
        if len(self.failed) == FAILED_MOST:
            raise SearchEnded(code, f"{FAILED_MOST} trials failed, the last one because: {reason}")

    def _value(self, folder: Path, total: int) -> float | None:
        if self.options.objective == "evaluation":
            return goal_in_evaluation(folder / "evaluation.json", self.goal.name)
        return goal_at_the_end(folder / "metrics.csv", total, self.goal.name)

    def _so_far(self) -> str:
        done = len(self._trials(*ENDED))
        best = best_of(self.study, self.goal)
        said = "" if best is None else f", the best is trial {best.number} with {told(best.value or 0.0, self.goal)}"
        return f"{done} of {self.options.trials} trials{said}"

    def _how_to_go_on(self) -> str:
        return f"the same command with search.out={self.folder} goes on"

    def _stop(self) -> None:
        """Stop the running trials, which save; for Optuna they are still running, and the next search resumes them."""
        for each in self._running:
            each.stop()
        while any(training.poll() is None for each in self._running for training in each.trainings):
            time.sleep(min(self.seconds, 0.1))


ENDED = (TrialState.COMPLETE, TrialState.PRUNED)
"""What counts as a trial; failed ones do not."""


def best_of(study: optuna.Study, goal: Metric = SAVED) -> FrozenTrial | None:
    """Return the trial of the best value by a goal, None where none was trained to its end."""
    done = study.get_trials(deepcopy=False, states=(TrialState.COMPLETE,))
    return max(done, key=lambda each: sign_of(goal) * (each.value or 0.0), default=None)


def wait_until_free(folder: Path, seconds: float = _SECONDS_OF_A_SAVE) -> None:
    """Wait until no process trains into a folder: one whose search was killed saves before it ends.

    Raises:
        RunFolderInUse: If one still does after that time.
    """
    until = time.monotonic() + seconds
    while True:
        try:
            RunFolderLock(folder).release()
            return
        except RunFolderInUse:
            if time.monotonic() > until:
                raise
            time.sleep(0.2)


def _short(value: Value) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
