"""Progress of a run of the workflow: finished jobs of each stage, pours a minute, time left, and failures.

All times are seconds of the system's clock, which also dates files.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from repose.measure.saved_pours import POURS

# Rates of a shorter time are too uncertain.
SHORTEST_RATE_S = 1.0


@dataclass(frozen=True)
class Running:
    """A job that runs, or has failed."""

    stage: str
    message: str  # its work in words
    began_s: float
    pours: int  # planned runs of a bench test
    output: str = ""  # its first output

    def made(self) -> int | None:
        """Runs made so far, without those of an earlier job; None for a job that does not keep each run."""
        if not self.output.endswith(POURS):
            return None
        done = Path(self.output)
        kept = list((done.parent / "runs").glob(f"{done.name.removesuffix(POURS)}_*.npz"))
        fresh = sum(path.stat().st_mtime >= self.began_s for path in kept)
        return min(self.pours, fresh) if kept else None


@dataclass
class Stage:
    """A stage of the workflow."""

    done: int = 0  # jobs
    total: int = 0  # jobs


@dataclass
class RunProgress:
    """The state of a run while it goes on."""

    stages: dict[str, Stage] = field(default_factory=dict)  # those with work, in the order of the workflow
    running: dict[int, Running] = field(default_factory=dict)  # by the job's number
    failed: dict[int, Running] = field(default_factory=dict)  # by the job's number, until it begins again
    _stage_of: Mapping[str, str] = field(default_factory=dict)  # stage of each rule
    _planned: dict[int, tuple[int, float]] = field(default_factory=dict)  # runs, expected time on a core [s]
    _done: dict[int, int] = field(default_factory=dict)  # by the job's number: runs made
    _began_s: float | None = None
    _first_pour_s: float | None = None

    def plan(self, stage_of: Mapping[str, str], jobs: Mapping[str, Mapping[int, tuple[int, float]]]) -> None:
        """Take the stage of each rule, in the order of the workflow, and of each rule its planned jobs by number.

        A job is its runs of a bench test and its expected time on a core [s].
        """
        self._stage_of = stage_of
        for name in dict.fromkeys(stage_of.values()):
            numbers = [number for rule in jobs if stage_of.get(rule) == name for number in jobs[rule]]
            if numbers:
                self.stages[name] = Stage(total=len(numbers))
        self._planned = {number: told for known in jobs.values() for number, told in known.items()}

    def start(self, number: int, rule: str, message: str, output: str, now_s: float) -> Running:
        """A job begins, or begins again; `message` is its work in words, `output` its first output."""
        name = self._stage_of.get(rule, rule)
        if number not in self._planned:  # a checkpoint has added it
            self._planned[number] = (0, 0.0)
            self.stages.setdefault(name, Stage()).total += 1
        self.failed.pop(number, None)
        job = Running(name, message, now_s, self._planned[number][0], output)
        self.running[number] = job
        self._began_s = now_s if self._began_s is None else self._began_s
        if job.pours and self._first_pour_s is None:
            self._first_pour_s = now_s
        return job

    def finish(self, number: int) -> None:
        """A job has ended well."""
        job = self.running.pop(number, None)
        if job is not None:
            made = job.made()
            self._done[number] = job.pours if made is None else made
            self.stages[job.stage].done += 1

    def fail(self, number: int) -> Running | None:
        """A job has failed; None if that is known already."""
        job = self.running.pop(number, None)
        if job is not None:
            self.failed[number] = job
        return job

    @property
    def pours_done(self) -> int:
        """Pours that this run has made, those of unfinished jobs included."""
        return sum(self._done.values()) + sum(job.made() or 0 for job in self.running.values())

    def pours_a_minute(self, now_s: float) -> float | None:
        """Rate since the first pour began; None before the first is made."""
        done = self.pours_done
        if not done or self._first_pour_s is None or now_s - self._first_pour_s < SHORTEST_RATE_S:
            return None
        return 60 * done / (now_s - self._first_pour_s)

    def left_s(self, now_s: float) -> float | None:
        """Time that the planned jobs still take, at the rate of the finished ones; None before that is known.

        Where pours are planned, that is before the first of them is made.
        """
        pouring = any(pours for pours, _ in self._planned.values())
        began_s = self._first_pour_s if pouring else self._began_s
        if began_s is None or now_s - began_s < SHORTEST_RATE_S or (pouring and not self.pours_done):
            return None
        whole_s = sum(work_s for _, work_s in self._planned.values())
        done_s = sum(self._share_done(number) * work_s for number, (_, work_s) in self._planned.items())
        return (whole_s - done_s) * (now_s - began_s) / done_s if done_s else None

    def _share_done(self, number: int) -> float:
        """The finished share of a job."""
        if number in self._done:
            return 1.0
        job = self.running.get(number)
        return (job.made() or 0) / job.pours if job and job.pours else 0.0


def in_words(seconds: float) -> str:
    """A rough time in words."""
    minutes = round(seconds / 60)
    if minutes < 1:
        return "less than a minute"
    if minutes < 90:
        return f"about {minutes} min"
    return f"about {minutes // 60} h {minutes % 60} min"
