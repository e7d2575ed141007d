"""Whether the quick tests notice a wrong line: `python tests/mutants/mutants.py [PART OF A FILE'S NAME]`.

Each mutant of mutants.yaml is put into a clone of the last commit, and its tests run there, without the compiler, up to
the first that fails. A mutant is caught if one does. The table of all of them goes to tests/mutants/table.md.
"""

import os

# Before numba is loaded: nothing compiles. A test that needs the compiler is skipped.
os.environ["NUMBA_DISABLE_JIT"] = "1"

import importlib
import sys
import tempfile
from pathlib import Path

import yaml
from random_lines import HERE, LOADED, cloned, tested, written

MOST_S = 120  # of CPU time; a mutant that takes longer is caught, too


def main():
    only = sys.argv[1] if len(sys.argv) > 1 else ""
    groups = yaml.safe_load((HERE / "mutants.yaml").read_text())
    groups = [group for group in groups if only in group["file"]]
    for name in (*LOADED, "numba"):
        importlib.import_module(name)
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = cloned(name)
        for tests in {tuple(group["tests"]) for group in groups}:
            if tested(folder, tests, False, MOST_S)[0]:
                sys.exit(f"{' '.join(tests)} fail without any mutant")
        for group in groups:
            path = folder / "src/repose" / group["file"]
            content = path.read_text()
            for old, new, *why in group["mutants"]:
                if content.count(old) != 1:
                    sys.exit(
                        f"{path}: {old!r} stands there {content.count(old)} times; it must be once"
                    )
                path.write_text(content.replace(old, new))
                status, _ = tested(folder, group["tests"], False, MOST_S)
                path.write_text(content)
                found = "caught" if status else f"**survived** {''.join(why)}".strip()
                rows.append(f"| {group['file']} | `{old}` | `{new}` | {found} |")
                print(rows[-1], flush=True)
    written(Path(os.devnull) if only else HERE / "table.md", rows, "file")


if __name__ == "__main__":
    main()
