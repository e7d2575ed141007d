"""Whether the quick tests notice wrong lines that nobody chose: `python tests/mutants/random_lines.py`.

Every room of src/repose gives as many mutants. A place in it is drawn and made wrong in one of the ways of `kinds.py`.
In a clone of the last commit the quick tests that name the module run up to the first that fails; those of the engine
without the compiler. Outside the engine, what survives meets the rules for every module and all quick tests of its
room. The table goes to tests/mutants/random_lines.md. An interrupted run goes on where it stopped, as long as the last
commit is the same.

The next draw is of 60 lines with the seed 5127733. Write the seed after it here before that one is drawn.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy is loaded

import argparse
import importlib
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from kinds import Source

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
SOURCE = ROOT / "src/repose"
SEED = 5127733
LONGEST_S = 60  # of CPU time of the tests of a module; where they take longer without a mutant, its own file alone
MOST_S = 300  # of CPU time of these; a mutant that takes longer is caught, too
LOADED = (
    "numpy",
    "scipy.stats",
    "scipy.optimize",
    "scipy.spatial",
    "pandas",
    "cv2",
    "pytest",
    "xdist.scheduler",
)
PYTEST = ("-p", "no:cacheprovider", "-o", "addopts=", "-m", "not slow", "-x", "-q")
NO_TEST = 5  # status of pytest
# Rules for every module, whatever its room.
OF_ALL_MODULES = (
    "tests/common/test_exchanged_arguments.py",
    "tests/config/test_settings.py",
)


def drawn(number, seed):
    """Draw modules with a wrong content each, the rooms one after another."""
    random = np.random.default_rng(seed)
    rooms = sorted(
        path for path in SOURCE.iterdir() if path.is_dir() and any(path.rglob("*.py"))
    )
    places = {}
    for room in rooms[:number]:
        sources = {
            path: Source(path.read_bytes()) for path in sorted(room.rglob("*.py"))
        }
        places[room] = [
            (path, source, place)
            for path, source in sources.items()
            for place in source.places()
        ]
    chosen = []
    while len(chosen) < number:
        of_room = places[rooms[len(chosen) % len(rooms)]]
        path, source, place = of_room.pop(random.integers(len(of_room)))
        wrong = place.wrong[random.integers(len(place.wrong))]
        content = source.changed(place, wrong)
        if content is not None:
            chosen.append((path, place.start, content))
    return chosen


def written(path, rows, where, how=""):
    """Write the table of mutants, whose first column has this head, and print how many were caught."""
    caught = f"{sum(row.endswith('| caught |') for row in rows)} of {len(rows)} caught"
    print(caught)
    head = f"| {where} | line | mutant | found |\n|---|---|---|---|\n"
    path.write_text(f"{caught}{how}.\n\n" + head + "\n".join(rows) + "\n")


def tests_of(path):
    """Test files that name a module, its own first."""
    room, dotted = (
        path.relative_to(SOURCE).parts[0],
        ".".join(path.relative_to(SOURCE).with_suffix("").parts),
    )
    parent, _, stem = dotted.rpartition(".")
    imported = rf"from repose\.{re.escape(parent)} import [^\n]*\b{stem}\b"
    named = re.compile(rf"repose\.{re.escape(dotted)}\b|{imported}|\b{stem}\.")
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    own = [file for file in files if file.name == f"test_{stem}.py"]
    others = [
        file for file in files if file not in own and named.search(file.read_text())
    ]
    others.sort(key=lambda file: file.relative_to(ROOT / "tests").parts[0] != room)
    chosen = own + others or [ROOT / "tests" / room]
    return [str(file.relative_to(ROOT)) for file in chosen], len(own)


def cloned(name):
    subprocess.run(["git", "clone", "-q", ROOT, name], check=True)
    return Path(name)


def tested(folder, tests, compiled, most_s):
    """Run tests of a copy in a fork, where the libraries are loaded already: its exit status, and what it printed."""
    with tempfile.TemporaryFile("w+") as out:
        child = os.fork()
        if child == 0:
            resource.setrlimit(resource.RLIMIT_CPU, (most_s, most_s))
            os.chdir(folder)
            for number in (1, 2):
                os.dup2(out.fileno(), number)
            sys.dont_write_bytecode = True
            sys.path[:0] = [f"{folder}/src", str(folder)]
            os.environ |= {
                "PYTHONPATH": f"{folder}/src:{folder}",
                "PYTHONDONTWRITEBYTECODE": "1",
            }
            os.environ |= {} if compiled else {"NUMBA_DISABLE_JIT": "1"}
            status = 1
            try:
                status = int(importlib.import_module("pytest").main([*PYTEST, *tests]))
            finally:
                sys.stdout.flush()
                os._exit(status)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        out.seek(0)
        return status, out.read()


def found(folder, path, wrong):
    """Whether tests catch wrong content of a module. Those that fail, or take too long, must do it for that alone."""
    where, text = folder / path.relative_to(ROOT), path.read_bytes()
    room = path.relative_to(SOURCE).parts[0]
    (tests, own), compiled = tests_of(path), room != "dem"

    def fails(tests, most_s):
        where.write_bytes(wrong)
        status, said = tested(folder, tests, compiled, most_s)
        where.write_bytes(text)
        if status in (0, NO_TEST):
            return False
        guilty = (
            re.findall(r"^(?:FAILED|ERROR) (.*?)(?: - .*)?$", said, re.MULTILINE)[:1]
            or tests
        )
        clean, _ = tested(folder, guilty, compiled, most_s)
        if clean > 0:
            raise SystemExit(f"{' '.join(guilty)} fail without any mutant")
        return None if clean < 0 else True

    caught = fails(tests, LONGEST_S)
    if caught is None:  # they take too long without a mutant, too
        caught = fails(tests[: max(own, 1)], MOST_S)
    rest = [*OF_ALL_MODULES, f"tests/{room}"]
    return bool(caught) or (compiled and bool(fails(rest, MOST_S)))


def commit():
    """The last commit, whose lines are drawn."""
    command = ["git", "rev-parse", "HEAD"]
    return subprocess.check_output(command, cwd=ROOT, text=True).strip()


def rows_of_unfinished(path, draw):
    """Rows that an interrupted run of the same draw has left in a file, which this starts."""
    if path.exists():
        first_line, *rows = path.read_text().splitlines()
        if first_line == draw:
            return rows
    path.write_text(f"{draw}\n")
    return []


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--mutants", type=int, default=60)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--out", default=HERE / "random_lines.md", type=Path)
    arguments = parser.parse_args()
    for name in LOADED:
        importlib.import_module(name)
    unfinished = arguments.out.with_suffix(".part")
    rows = rows_of_unfinished(unfinished, draw=f"{commit()} seed {arguments.seed}")
    with tempfile.TemporaryDirectory() as name:
        folder = cloned(name)
        mutants = drawn(arguments.mutants, arguments.seed)
        for path, start, wrong in mutants[len(rows) :]:
            text = path.read_bytes()
            number = text[:start].count(b"\n")
            before, after = (
                content.splitlines()[number].decode().strip()
                for content in (text, wrong)
            )
            how = "caught" if found(folder, path, wrong) else "**survived**"
            row = f"| {path.relative_to(SOURCE)} {number + 1} | `{before}` | `{after}` | {how} |"
            rows.append(row)
            print(row, flush=True)
            with unfinished.open("a") as file:
                file.write(f"{row}\n")
    unfinished.unlink()
    written(arguments.out, rows, "place", f", seed {arguments.seed}")


if __name__ == "__main__":
    main()
