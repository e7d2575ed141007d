"""The same study in many environments: whether its results are the same bits; see README.md.

python tests/same_bits/environments.py [NAME ...] --work FOLDER
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PLAIN = "plain"
LARGEST_SCORE = 3.0  # mean difference of all runs over its standard error, of another type of processor
LARGEST_APART = 1e-6  # of a number of a table over the spread of its column, where the pours are the same bits
# In every file that says what made it; another Python or processor changes them and nothing else.
MACHINE = re.compile(rb'\\?"(python|processor|numpy|numba)\\?": \\?"[^"\\]*\\?"')
# Of one Python thread and one thread of linear algebra; the rest of the environment is the caller's.
USUAL = {"OPENBLAS_NUM_THREADS": "1"}
UNSHARED = """
set -e
for folder in "{root}" "$HOME"; do
    mount --bind "$folder" "$folder"
    mount -o remount,ro,bind "$folder"
done
exec "$@"
"""


@dataclass(frozen=True)
class Environment:
    """How a study is run: variables that are set, its folder, what is read-only, and which Python runs it.

    cold: the kernels are compiled anew, in a folder of its own. type: it stands for another type of processor, whose
    bits may differ.
    """

    what: str
    variables: dict = field(default_factory=dict)
    folder: str = "study"
    read_only: bool = False
    cold: bool = False
    type: bool = False
    python: str | None = None


ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
AWAY = {"TZ": "Pacific/Kiritimati"}
HASH = {"PYTHONHASHSEED": "7"}
THREADS = {"OPENBLAS_NUM_THREADS": "2", "OMP_NUM_THREADS": "2"}
ODD = "my 'stüdy' {x} -rf"
ENVIRONMENTS = {
    PLAIN: Environment("a folder, the caller's environment"),
    "again": Environment("the same once more"),
    "ascii": Environment("ASCII locale, UTF-8 mode off", ASCII),
    "time_zone": Environment("time zone Pacific/Kiritimati", AWAY),
    "hash_seed": Environment("another hash seed of Python", HASH),
    "threads": Environment("two threads of linear algebra", THREADS),
    "folder": Environment(
        "a folder with blanks, quotes, braces and umlauts", folder=ODD
    ),
    "read_only": Environment("HOME and source read-only", read_only=True),
    "all_at_once": Environment(
        "the six lines above at once",
        ASCII | AWAY | HASH | THREADS,
        ODD,
        read_only=True,
    ),
    "cold": Environment("kernels compiled anew", cold=True),
    "python3.12": Environment("Python 3.12", cold=True, python="3.12"),
    "python3.13": Environment("Python 3.13", cold=True, python="3.13"),
    "blas_haswell": Environment(
        "OPENBLAS_CORETYPE=Haswell", {"OPENBLAS_CORETYPE": "Haswell"}, type=True
    ),
    "blas_nehalem": Environment(
        "OPENBLAS_CORETYPE=Nehalem", {"OPENBLAS_CORETYPE": "Nehalem"}, type=True
    ),
    "numba_generic": Environment(
        "NUMBA_CPU_NAME=generic", {"NUMBA_CPU_NAME": "generic"}, cold=True, type=True
    ),
}


def run(name, work, pythons):
    environment = ENVIRONMENTS[name]
    folder = work / name / environment.folder
    done = work / name / "status"
    if done.is_file():
        return int(done.read_text())
    python = pythons.get(environment.python) if environment.python else sys.executable
    if python is None or (environment.read_only and os.geteuid() != 0):
        return None
    shutil.rmtree(work / name, ignore_errors=True)
    folder.mkdir(parents=True)
    variables = (
        os.environ | USUAL | environment.variables | {"PYTHONPATH": str(ROOT / "src")}
    )
    if environment.cold:
        variables["NUMBA_CACHE_DIR"] = str(work / name / "kernels")
    command = [python, str(HERE / "chain.py")]
    if environment.read_only:
        command = [
            "unshare",
            "-m",
            "bash",
            "-c",
            UNSHARED.format(root=ROOT),
            "bash",
            *command,
        ]
    with (work / name / "log.txt").open("wb") as log:
        status = subprocess.run(
            command, cwd=folder, env=variables, stdout=log, stderr=log
        ).returncode
    done.write_text(f"{status}\n")
    return status


def results(folder):
    """Content of every result by name; without Python, versions and processor in its record."""
    top = folder / "results"
    files = (
        path
        for path in sorted(top.rglob("*"))
        if path.is_file() and not path.name.startswith(".")
    )
    return {
        str(path.relative_to(top)): _content(path)
        for path in files
        if "timings" not in path.parts
    }


def _content(path):
    """The bytes of a file; of an archive those of its arrays, of a picture those of its pixels."""
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            return {
                name: MACHINE.sub(b"", arrays[name].tobytes())
                for name in arrays
                if name != "provenance"
            }
    if path.suffix == ".png":
        import cv2

        return cv2.imread(str(path), cv2.IMREAD_UNCHANGED).tobytes()
    return MACHINE.sub(b"", path.read_bytes())


def spread_of(folder, plain):
    """The largest difference of a number of each table, over the spread of its column; its size where all are equal."""
    found = {}
    for path in sorted((plain / "results").rglob("*.csv")):
        name = str(path.relative_to(plain / "results"))
        first = pd.read_csv(plain / "results" / name)
        second = pd.read_csv(folder / "results" / name)
        if first.shape != second.shape:
            found[name] = np.inf
            continue
        numbers = first.select_dtypes("number").columns
        spread = first[numbers].std(ddof=0).fillna(0.0)
        size = first[numbers].abs().max().fillna(0.0)
        apart = (first[numbers] - second[numbers]).abs() / spread.where(
            spread > 1e-12 * size, size
        ).replace(0.0, 1.0)
        found[name] = float(apart.max().max()) if len(numbers) and len(first) else 0.0
    return found


def ensembles(folder, plain):
    """Mean difference of all runs and its standard error, for each response."""
    first = pd.read_csv(plain / "results/runs.csv")[["aor_deg", "height_mm"]]
    second = pd.read_csv(folder / "results/runs.csv")[["aor_deg", "height_mm"]]
    apart = second - first
    return {name: (apart[name].mean(), apart[name].sem()) for name in apart}


def row(name, work, status):
    """The row of an environment: equal files, those that differ, and by how much; bold where that is too much."""
    environment = ENVIRONMENTS[name]
    if status is None:
        return f"| {environment.what} | not run | | |"
    if status != 0:
        return f"| {environment.what} | **ended with {status}** | | |"
    plain = work / PLAIN / ENVIRONMENTS[PLAIN].folder
    folder = work / name / environment.folder
    expected = results(plain)
    found = results(folder)
    different = sorted(
        file for file in {*expected, *found} if expected.get(file) != found.get(file)
    )
    same = f"{len(expected) - len(different)} of {len(expected)}"
    if not different:
        return f"| {environment.what} | {same} | | |"
    # on the same type of processor all bits have to agree
    if not environment.type:
        return f"| {environment.what} | **{same}** | {', '.join(different[:8])} | |"
    # where the pours themselves differ, these are two draws of one ensemble
    if any(file.endswith(".npz") for file in different):
        means = ensembles(folder, plain)
        listed = ", ".join(
            f"{name} {mean:+.2f} ± {error:.2f}" for name, (mean, error) in means.items()
        )
        if any(abs(mean) > LARGEST_SCORE * error for mean, error in means.values()):
            same = f"**{same}**"
        return f"| {environment.what} | {same} | pours, and what stands on them | {listed} |"
    apart = {
        file: share for file, share in spread_of(folder, plain).items() if share > 0.0
    }
    listed = ", ".join(f"{file} {share:.1e}" for file, share in apart.items())
    if max(apart.values(), default=0.0) > LARGEST_APART:
        same = f"**{same}**"
    return f"| {environment.what} | {same} | {listed} | |"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="environments; all without any")
    parser.add_argument(
        "--work",
        type=Path,
        help="folder of the studies; what ran there is not run again",
    )
    parser.add_argument(
        "--python", nargs="*", default=[], help="other Pythons, as 3.12=/path/to/python"
    )
    args = parser.parse_args()
    work = (args.work or Path(tempfile.mkdtemp())).absolute()
    pythons = dict(python.split("=", 1) for python in args.python)
    names = args.names or list(ENVIRONMENTS)
    statuses = {
        name: run(name, work, pythons)
        for name in (PLAIN, *(name for name in names if name != PLAIN))
    }
    lines = [
        "| environment | same files | others; of a table the largest difference over the spread of its column |"
        " mean difference of all runs and its standard error |",
        "|---|---|---|---|",
        *(row(name, work, status) for name, status in statuses.items()),
    ]
    print("\n".join(lines))
    if not args.names:
        (HERE / "table.md").write_text("\n".join(lines) + "\n")
    return int(any("**" in line for line in lines))


if __name__ == "__main__":
    sys.exit(main())
