"""Faults of the machine on a tiny study: kills, damage, lost files, no space. `python tests/faults/campaign.py`.

After each fault the same command is given again. Its results must be the bytes of an undisturbed run, and no file that
was finished may be made again. What happened is written to tests/faults/table.md.
"""

import argparse
import math
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import closing, suppress
from pathlib import Path

import forked
from forked import TARGETS, Study, compared

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
VICTIMS = ("the workflow", "a job", "all")
# a kill comes after fewer: kills fall on all stages, on a busy machine, too
MORE_FILES = 25
FORCED = ("design", "pour", "measure_runs", "network", "solutions")
# A file of each kind for truncation and flipped bits; the last three are the program's and snakemake's own.
DAMAGED = (
    "results/design/samples.csv",
    "results/dataset.csv",
    "results/berry/particle.json",
    "results/heaps/003.npz",
    "results/heaps/004.pours.json",
    "results/heaps/005.json",
    "results/network/network.json",
    "results/validation/solutions.csv",
    "results/measure/overlay.png",
    "results/heaps/runs",
    "results/config.json",
    "results/heaps/.repose",
    ".snakemake/metadata",
)
VERDICTS = {True: "yes", False: "**no**", None: "not yet compared"}
LOST = (
    "results/design/samples.csv",
    "results/heaps/003.npz",
    "results/heaps/004.pours.json",
    "results/heaps/005.json",
    "results/dataset.csv",
    "results/network/network.json",
    "results/validation/heaps/001.npz",
    "results/validation",
    "results/heaps",
    ".snakemake",
)


HEAD = "| fault | where | exit status | same bytes after the same command | finished files made again |"


class Table(list):
    """The faults of a campaign, in a file that holds each row as soon as it is known."""

    def __init__(self, path):
        super().__init__()
        self.path = Path(path)

    def add(self, fault, place, then, same, again):
        """Add a row and print it; `same` is None before the study has ended."""
        row = [
            fault,
            place,
            then,
            VERDICTS[same],
            "none" if not again else f"**{len(again)}**",
        ]
        self.append(row)
        print(" | ".join(row), *map(str, list(again)[:5]), flush=True)
        self._write()
        return row

    def compare(self, rows, same):
        """Say of the faults of one study whether it ended with the same bytes."""
        for row in rows:
            row[3] = VERDICTS[same]
        print(
            f"{len(rows)} faults of a study, same bytes: {VERDICTS[same]}", flush=True
        )
        self._write()

    def _write(self):
        lines = [HEAD, "|---" * 5 + "|", *(f"| {' | '.join(row)} |" for row in self)]
        self.path.write_text("\n".join(lines) + "\n")


def kills(place, finished, expected, table, count, seed):
    """Kill a workflow, one of its jobs or all at random moments, again and again, until the study ends; repeat."""
    rng = random.Random(seed)
    done = number = 0
    while done < count:
        number += 1
        study = Study(
            place / f"killed_{number}", finished.jobs, finished.targets
        ).prepared()
        rows = []
        status = 1
        before = {}
        loose = False
        while status and len(rows) < 15:
            forced = (FORCED[rng.randrange(len(FORCED))],) if rng.random() < 0.3 else ()
            main = study.start(*forced)
            victim = rng.choice(VICTIMS)
            signal_number = SIGNALS[done % 3]
            moment = rng.randrange(MORE_FILES), rng.uniform(0.0, 1.0)
            killed = (
                _kill(study, main, signal_number, victim, *moment)
                if done < count
                else False
            )
            try:
                status = forked.ended(main)
            except TimeoutError as error:
                status = f"**{error}**"
            now = study.finished()
            # once a rule was forced, what stands on it is made anew, but no pour
            loose = loose or bool(forced)
            kept = {
                path: when
                for path, when in before.items()
                if "timings" in path.parts or not loose
            }
            again = study.made_again(kept)
            if killed:
                done += 1
                where = f"{victim}, {len(now)} files finished" + (
                    f", --forcerun {forced[0]}" if forced else ""
                )
                name = signal.Signals(signal_number).name
                rows.append(table.add(name, where, str(status), None, again))
                status = 1
            elif again or isinstance(status, str):
                where = "the resumed run"
                rows.append(table.add("none", where, str(status), None, again))
            before = now
            if not killed and status:
                print(f"    {study.last_words()}")
                break
        same = compared(study, expected)
        table.compare(rows, same)
        if same:
            shutil.rmtree(study.folder)


def _kill(study, main, number, victim, more, after_s):
    """Whether these were killed before the study ended."""
    records = study.folder / ".snakemake/metadata"
    end = math.inf
    expected = len(list(records.glob("*"))) + more
    while True:
        if os.waitid(os.P_PID, main, os.WEXITED | os.WNOHANG | os.WNOWAIT):
            return False
        jobs = study.jobs.running()
        if end == math.inf and len(list(records.glob("*"))) >= expected:
            end = time.monotonic() + after_s
        if time.monotonic() >= end and (jobs or victim != "a job"):
            break
        time.sleep(0.01)
    hit = False
    for process in {"the workflow": [main], "a job": jobs[:1], "all": [main, *jobs]}[
        victim
    ]:
        with suppress(ProcessLookupError):  # it has ended just now
            os.kill(process, number)
            hit = True
    return hit


def damages(place, finished, expected, table):
    """Files of a finished study that are cut, flipped or lost."""
    for way, names in (
        ("half of it lost", DAMAGED),
        ("a bit flipped", DAMAGED),
        ("lost", LOST),
    ):
        for name in names:
            study = finished.copied_to(place / "damaged")
            path = study.folder / name
            if way == "lost":
                shutil.rmtree(path) if path.is_dir() else path.unlink()
            else:
                path = sorted(path.glob("*"))[5] if path.is_dir() else path
                content = bytearray(path.read_bytes())
                if way == "a bit flipped":
                    content[len(content) // 2] ^= 1
                else:
                    del content[len(content) // 2 :]
                path.write_bytes(bytes(content))
            status = study.run()
            result = ""
            if way != "lost" and status and study.remove_what_it_named():
                result = f"{status} and named; removed, then "
                status = study.run()
            again = [] if name == "results/heaps" else _repoured(study, finished, path)
            table.add(way, name, f"{result}{status}", compared(study, expected), again)
            shutil.rmtree(study.folder)


def _repoured(study, finished, damaged):
    top = study.folder / "results"
    now = study.pours()
    design = {
        path: when
        for path, when in finished.pours().items()
        if path.parts[0] == "heaps"
    }
    return [
        path
        for path, when in design.items()
        if top / path != damaged and now.get(path) != when
    ]


def changes(place, finished, expected, table):
    """Another workflow in the same folder meanwhile, and changed keys beside a new study with them."""
    jobs = finished.jobs
    study = Study(place / "two", jobs).prepared()
    first = study.start()
    while not jobs.running():
        time.sleep(0.01)
    second = Study(study.folder, jobs).configured(simulation={"gravity_m_s2": 1.62})
    second.log = Path(f"{study.folder}_second.log")
    statuses = f"{second.run()}; the first {forked.ended(first)}"
    table.add(
        "a second workflow meanwhile",
        second.last_words(),
        statuses,
        compared(study, expected),
        [],
    )
    target = {
        "response": "height_mm",
        "apparatus": "funnel",
        "value": 60.0,
        "sd": 3.0,
        "repetitions": 5,
        "range": [55.0, 65.0],
    }
    for name, sections, poured in (
        ("one seed more", {"funnel": {"seeds": 2}}, 12),
        ("another target", {"targets": [target]}, 0),
        ("another network", {"network": {"hidden": 3}}, 0),
        ("another definition", {"measure": {"views": 3}}, 0),
    ):
        fresh = Study(place / "fresh", jobs).prepared().configured(**sections)
        fresh.run()
        study = finished.copied_to(place / "changed").configured(**sections)
        study.targets = TARGETS
        before = study.pours()
        status = study.run()
        after = study.pours()
        again = [path for path in before if after.get(path) != before[path]]
        new = {path for path in set(after) - set(before) if path.parts[0] == "heaps"}
        same = compared(study, fresh.results()) and len(new) == poured
        table.add(
            name,
            f"{len(new)} new pours of the design, {poured} wanted",
            str(status),
            same,
            again,
        )
        for folder in (fresh, study):
            shutil.rmtree(folder.folder)


def no_room(place, finished, expected, table):
    """A full disk, a disk that turns read-only, and too little memory, each in mid-run."""
    jobs = finished.jobs
    targets = finished.targets
    size = sum(map(len, expected.values())) // 1024
    for number, share in enumerate((0.2, 0.4, 0.6, 0.8)):
        study = Study(place / f"full_{number}", jobs, targets).prepared()
        results = study.folder / "results"
        results.mkdir()
        _mount("-t", "tmpfs", "-o", f"size={int(share * size) + 8}k", "tmpfs", results)
        try:
            status = study.run()
            before = study.finished()
            _mount("-o", "remount,size=500m", results)
            _again(
                study,
                expected,
                table,
                f"disk full at {share:.0%}",
                "results",
                status,
                before,
            )
            if number == 1:
                _mount("-o", "remount,ro", results)
                status = study.run("network")
                message = study.last_words()
                _mount("-o", "remount,rw", results)
                _again(study, expected, table, "read-only", "results", status, {})
                print(f"    {message}")
        finally:
            subprocess.run(["umount", results], check=True)
    study = Study(place / "memory", jobs, targets).prepared()
    limit = (
        int(Path(f"/proc/{jobs.process}/statm").read_text().split()[0])
        * resource.getpagesize()
        + 4_000_000
    )
    resource.prlimit(jobs.process, resource.RLIMIT_AS, (limit, resource.RLIM_INFINITY))
    status = study.run()
    before = study.finished()
    resource.prlimit(
        jobs.process,
        resource.RLIMIT_AS,
        (resource.RLIM_INFINITY, resource.RLIM_INFINITY),
    )
    _again(study, expected, table, "4 MB of memory left", "jobs", status, before)


def _mount(*arguments):
    subprocess.run(["mount", *arguments], check=True)


def _again(study, expected, table, fault, place, status, before):
    """Give the same command again, whose status with the fault is known, and what was finished before."""
    table.add(
        fault,
        place,
        f"{status}, then {study.run()}",
        compared(study, expected),
        study.made_again(before),
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=("kills", "damages", "changes", "no_room"))
    parser.add_argument(
        "--out",
        default=Path(__file__).with_name("table.md"),
        help="table of what happened",
    )
    parser.add_argument(
        "--real-pours",
        action="store_true",
        help="with the engine, which costs minutes more",
    )
    arguments = parser.parse_args()
    table = Table(arguments.out)
    # a shell lets what runs in the background ignore it
    signal.signal(signal.SIGINT, signal.default_int_handler)
    forked.load_all()
    if not arguments.real_pours:
        forked.make_up_pours()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        began = time.monotonic()
        with closing(forked.Jobs(place / "server")) as jobs:
            finished = Study(place / "undisturbed", jobs).prepared()
            if finished.run():
                sys.exit(finished.log.read_text())
            took = time.monotonic() - began
            expected = finished.results()
            names = sorted(
                str(path.relative_to(finished.folder)) for path in finished.finished()
            )
            mine = (
                name
                for name in names
                if "/runs/" not in name and "/timings/" not in name
            )
            finished.targets = (*TARGETS, *mine)
            print(f"undisturbed: {took:.1f} s, {len(expected)} files", flush=True)
            for part in (damages, changes, no_room):
                if arguments.only in (None, part.__name__):
                    part(place, finished, expected, table)
            if arguments.only in (None, "kills"):
                kills(place, finished, expected, table, arguments.kills, arguments.seed)
    bad = sum("**" in "".join(row[2:]) for row in table)
    print(f"{len(table)} faults, {bad} bad, {time.process_time():.0f} s")
    sys.exit(bool(bad))


if __name__ == "__main__":
    main()
