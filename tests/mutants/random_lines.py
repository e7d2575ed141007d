"""Whether the quick tests notice wrong lines that nobody chose: `python tests/mutants/random_lines.py [--mutants 60] [--seed 2026]`.

Each room of src/repose gives as many; a room's file is drawn by its number of places, and one place in it is made wrong: an
operator is another one, a comparison is turned, a number is another number. The tests that name the module run, without the
compiler, up to the first that fails. The table goes to tests/mutants/random_lines.md.
"""

import argparse
import ast
import os
import re
import resource
import tempfile
import time
from pathlib import Path

import numpy as np
from mutants import HERE, LOADED, ROOT, copied, tested

SOURCE = ROOT / "src/repose"
SWAPPED = {
    ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.FloorDiv: "*", ast.Mod: "*", ast.Pow: "*",
    ast.Lt: ">", ast.Gt: "<", ast.LtE: ">=", ast.GtE: "<=", ast.Eq: "!=", ast.NotEq: "==",
    ast.And: "or", ast.Or: "and",
}  # fmt: skip
LONGEST_S = 60  # of the tests of a module without a mutant; where all take longer, its own test file alone


def places(path):
    """(start, end, new text) of every place in a file that can be made wrong, as offsets of bytes."""
    text = path.read_bytes()
    starts = np.cumsum([0, *(len(line) for line in text.splitlines(keepends=True))])

    def span(node):
        return starts[node.lineno - 1] + node.col_offset, starts[node.end_lineno - 1] + node.end_col_offset

    def between(left, right, operator):
        begin, end = span(left)[1], span(right)[0]
        found = re.search(rb"[-+*/%<>=!]+|\band\b|\bor\b", text[begin:end])
        if found and type(operator) in SWAPPED:
            yield begin + found.start(), begin + found.end(), SWAPPED[type(operator)]

    tree = ast.parse(text)
    skipped = {id(inner) for node in ast.walk(tree) for part in typed(node) for inner in ast.walk(part)}
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.BinOp) and not isinstance(node.left, ast.JoinedStr | ast.Constant):
            yield from between(node.left, node.right, node.op)
        elif isinstance(node, ast.Compare):
            yield from between(node.left, node.comparators[0], node.ops[0])
        elif isinstance(node, ast.BoolOp):
            yield from between(node.values[0], node.values[1], node.op)
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
            value = node.value + 1 if isinstance(node.value, int) else 2 * node.value or 1.0
            yield (*span(node), repr(value))


def typed(node):
    """What a node holds that no run reads: annotations."""
    parts = (getattr(node, name, None) for name in ("annotation", "returns"))
    return [part for part in parts if isinstance(part, ast.AST)]


def drawn(number, seed):
    """Pairs of a file and a place, room after room."""
    random = np.random.default_rng(seed)
    rooms = sorted(path for path in SOURCE.iterdir() if path.is_dir() and any(path.rglob("*.py")))
    found = {
        room: [(path, place) for path in sorted(room.rglob("*.py")) for place in places(path)]
        for room in rooms
    }
    chosen = []
    for k in range(number):
        every = found[rooms[k % len(rooms)]]
        chosen.append(every.pop(random.integers(len(every))))
    return chosen


def tests_of(path):
    """Test files that name a module, its own first."""
    room, dotted = path.relative_to(SOURCE).parts[0], ".".join(path.relative_to(SOURCE).with_suffix("").parts)
    parent, _, stem = dotted.rpartition(".")
    named = re.compile(
        rf"repose\.{re.escape(dotted)}\b|from repose\.{re.escape(parent)} import [^\n]*\b{stem}\b|\b{stem}\."
    )
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    own = [file for file in files if file.name == f"test_{stem}.py"]
    others = [file for file in files if file not in own and named.search(file.read_text())]
    others.sort(key=lambda file: file.relative_to(ROOT / "tests").parts[0] != room)
    chosen = own + others or [ROOT / "tests" / room]
    return [str(file.relative_to(ROOT)) for file in chosen], len(own)


def main():
    """Draw the mutants, and test each."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--mutants", type=int, default=60)
    parser.add_argument("--seed", type=int, default=2026)
    arguments = parser.parse_args()
    for name in LOADED:
        __import__(name)
    rows, baseline = [], {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        copied(folder)
        for path, (start, end, new) in drawn(arguments.mutants, arguments.seed):
            tests, own = tests_of(path)
            if path not in baseline:
                began = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
                status = tested(folder, tests)
                if resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - began > LONGEST_S:
                    tests, status = tests[: max(own, 1)], 0
                if status not in (0, 5):  # 5: no test was left
                    raise SystemExit(f"{' '.join(tests)} fail without any mutant")
                baseline[path] = tests
            where = folder / path.relative_to(ROOT)
            text, stat = where.read_bytes(), where.stat()
            where.write_bytes(text[:start] + new.encode() + text[end:])
            number = text[:start].count(b"\n")
            before, after = (
                content.splitlines()[number].decode().strip() for content in (text, where.read_bytes())
            )
            status = tested(folder, baseline[path])
            where.write_bytes(text)
            os.utime(where, ns=(stat.st_atime_ns, time.time_ns()))
            found = "**survived**" if status in (0, 5) else "caught"
            row = f"| {path.relative_to(SOURCE)} {number + 1} | `{before}` | `{after}` | {found} |"
            rows.append(row.replace("||", "\\|\\|"))
            print(rows[-1], flush=True)
    caught = sum(row.endswith("| caught |") for row in rows)
    head = f"{caught} of {len(rows)} caught, seed {arguments.seed}.\n\n| file and line | line | mutant | found |\n|---|---|---|---|\n"
    (HERE / "random_lines.md").write_text(head + "\n".join(rows) + "\n")
    print(f"{caught} of {len(rows)} caught")


if __name__ == "__main__":
    main()
