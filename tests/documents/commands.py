"""Run the commands that stand in the documents, as they stand there.

`python tests/documents/commands.py` runs the quick ones, `--all` all that this machine can, and PAGE... those of some
pages alone. `commands.yaml` says of each command which it is, and why one is not run.

A command is an indented line that begins with one of PROGRAMS. A fenced block behind "Save this as `NAME`", "Save this
study as `NAME`" or "Save the following as `NAME`" is written to that file. The commands of a page run in one shell, one
after another, in a folder of their own: an empty one, or a copy of the checkout with a small configuration, which the
pages that are `in: checkout` share. The commands in the copy run the program of the copy, as those in a checkout do, so
that its small configuration is the built-in one, and no study of another grain is read over it.

`printed` of a page in `commands.yaml` names commands whose output the page shows, and a pattern of the lines that it
shows. The fenced block `text` behind such a command holds these lines. `--all` compares them with what the command
prints, and `--all --draw` writes them.
"""

import argparse
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

import yaml

from repose.config.loader import merge_with_defaults
from repose.config.pipeline import PipelineConfig

ROOT = Path(__file__).parents[2]
TABLE = Path(__file__).with_name("commands.yaml")
PROGRAMS = (
    "repose",
    "python",
    "python3",
    "snakemake",
    "snakedeploy",
    "pytest",
    "pip",
    "cp",
    "cd",
    "mkdir",
    "export",
    "docker",
    "apptainer",
    "apt-get",
    "tests/cluster/run.sh",
    "npm",
    "npx",
)
FOLDERS = (
    "benchmarks",
    "config",
    "crops",
    "docs",
    "examples",
    "research",
    "src",
    "tests",
)
DOCUMENTS = ("*.md", "resources/*.md", *(f"{folder}/**/*.md" for folder in FOLDERS))
INDENTED = re.compile(r"^ {4,}(\S.*)$")
# Its status says whether the targets are met. Those of a small run may be not met (3) or undecided (4).
ASKS = "repose card check "
SAVED = re.compile(r"[Ss]ave (?:this|the)\b[^`.]* as `([^`]+)`")
NUMBER = re.compile(r"\d+(?:\.\d+)?")
# Another processor pours slightly different piles, so that numbers of a few piles may differ by this fraction, or this much.
TOLERANCE = {"rel_tol": 0.4, "abs_tol": 5.0}
# Sections of config/quick.yaml that make the studies small; .test/config/config.yaml makes the calibration small.
STUDIES = (
    "posterior",
    "sensitivity",
    "refine",
    "response_surface",
    "sequential",
    "cylinder",
    "discharge",
    "turning",
)


def pages() -> list[str]:
    found = {path for pattern in DOCUMENTS for path in ROOT.glob(pattern)}
    return sorted(str(path.relative_to(ROOT)) for path in found)


def steps(text: str) -> Iterator[tuple[str, str]]:
    """The steps of a page, in its order: ("heading", line), ("command", line), or (name of a file, its content)."""
    name = ""
    fence = None
    prose = ""
    blank = False
    lines = iter(text.splitlines())
    for line in lines:
        if line.startswith("```"):
            if fence is None:
                saved = SAVED.findall(prose)
                name = saved[-1] if saved else ""
                fence = []
            else:
                if name:
                    yield name, "".join(f"{text_line}\n" for text_line in fence)
                fence = None
                prose = ""
        elif fence is not None:
            fence.append(line)
        elif found := INDENTED.match(line):
            command = found[1]
            while command.endswith("\\"):
                command = f"{command[:-1].rstrip()} {next(lines).strip()}"
            if command.split()[0] in PROGRAMS:
                yield "command", re.sub(r"\s+# .*", "", command)
        elif line.startswith("#"):
            yield "heading", line
        elif line.strip():
            prose = line if blank else f"{prose} {line}"
        blank = not line.strip()


def kind(entry: dict, command: str) -> str:
    for name in ("quick", "full", "left_out"):
        if command in (entry.get(name) or ()):
            return name
    raise KeyError(command)


def find_printed(text: str, commands: Iterable[str]) -> dict[str, tuple[int, int]]:
    """First and last line, as a slice, inside the block `text` behind each of these commands of a page."""
    lines = text.splitlines()
    found = {}
    for command in commands:
        start = lines.index("```text", lines.index(f"    {command}")) + 1
        found[command] = start, lines.index("```", start)
    return found


def show_printed(text: str, shown: dict[str, list[str]]) -> str:
    """The text of a page whose blocks hold these lines, by command."""
    lines = text.splitlines()
    places = find_printed(text, shown)
    # From the last block on, so that the line numbers of the blocks before it hold.
    for command in sorted(shown, key=places.get, reverse=True):
        start, end = places[command]
        lines[start:end] = shown[command]
    return "\n".join([*lines, ""])


def agree(line: str, other: str) -> bool:
    """Whether two printed lines have the same words, and numbers that another processor may give."""
    # Spaces that align columns depend on the width of the numbers.
    line, other = (" ".join(text.split()) for text in (line, other))
    if NUMBER.split(line) != NUMBER.split(other):
        return False
    pairs = zip(NUMBER.findall(line), NUMBER.findall(other), strict=True)
    return all(math.isclose(float(a), float(b), **TOLERANCE) for a, b in pairs)


def compare_printed(page: str, shown: dict[str, list[str]]) -> None:
    """SystemExit where a page shows other lines than its commands print."""
    text = (ROOT / page).read_text()
    for command, (start, end) in find_printed(text, shown).items():
        lines = text.splitlines()[start:end]
        same = len(lines) == len(shown[command]) and all(
            map(agree, lines, shown[command])
        )
        if not same:
            printed = "\n".join(shown[command])
            sys.exit(
                f"{page}: `{command}` prints otherwise; --all --draw writes it:\n{printed}"
            )


def script(page: str, entry: dict, everything: bool) -> str:
    """The shell script of a page: files and commands in their order; empty where there is nothing to run."""
    chosen = ("quick", "full") if everything else ("quick",)
    lines = []
    commands = 0
    for what, text in steps((ROOT / page).read_text()):
        if what == "heading":
            lines += ['cd "$page"'] if entry.get("sections") == "apart" else []
        elif what != "command":
            lines.append(
                f"mkdir -p {Path(what).parent}; cat > {what} <<'END_OF_FILE'\n{text}END_OF_FILE"
            )
        elif kind(entry, text) in chosen:
            run_line = (
                f"{text} || [[ $? =~ ^[34]$ ]]" if text.startswith(ASKS) else text
            )
            if everything and text in (entry.get("printed") or {}):
                run_line = f"{text} 2>&1 | tee {place_of_output(page, entry, text)}"
            lines += [f"echo {shlex.quote('+ ' + text)}", run_line]
            commands += 1
    if not commands:
        return ""
    before = entry.get("before", "") if everything else ""
    return "\n".join(["set -eo pipefail", "page=$PWD", before, *lines, ""])


def checkout(folder: Path) -> Path:
    """A copy of the checkout whose configuration is small."""
    other = (".git", ".venv", ".snakemake", ".*_cache", "__pycache__")
    shutil.copytree(
        ROOT,
        folder,
        ignore=shutil.ignore_patterns(*other, "_build", "results", ".repose"),
    )
    shutil.copytree(ROOT / "results/published", folder / "results/published")
    quick = PipelineConfig.load(ROOT / "config/quick.yaml").config
    small = yaml.safe_load((ROOT / ".test/config/config.yaml").read_text())
    content = {name: quick[name] for name in STUDIES} | small
    content["funnel"]["seeds"] = 2  # the studies take the noise from runs of one sample
    # so that the published solutions are poured
    content["validation"]["published"] = quick["validation"]["published"]
    # the built-in configuration of the copy, so it needs every key
    whole = merge_with_defaults([ROOT / "config/config.yaml"], content).config
    (folder / "config/config.yaml").write_text(yaml.safe_dump(whole, sort_keys=False))
    return folder


def run(page: str, text: str, folder: Path) -> float:
    """Run a page's script; seconds that it took. SystemExit where a command fails."""
    began = time.perf_counter()
    program = folder if (folder / "src").is_dir() else ROOT
    env = os.environ | {
        "CHECKOUT": str(ROOT),
        "PYTHONPATH": os.pathsep.join(map(str, (program / "src", program))),
    }
    env |= {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(
        ["bash", "-c", text], cwd=folder, env=env, capture_output=True, text=True
    )
    if done.returncode:
        sys.exit(
            f"{page}: status {done.returncode}\n{done.stdout[-4000:]}\n{done.stderr[-4000:]}"
        )
    return time.perf_counter() - began


def place_of_output(page: str, entry: dict, command: str) -> str:
    """File for the output of a command, as a word of the page's script."""
    number = list(entry["printed"]).index(command)
    return f'"$page"/{Path(page).stem}_{number}.printed'


def read_printed(page: str, entry: dict, folder: Path) -> dict[str, list[str]]:
    """The lines that a page shows of what its commands have printed, by command."""
    shown = {}
    for number, (command, pattern) in enumerate((entry.get("printed") or {}).items()):
        text = (folder / f"{Path(page).stem}_{number}.printed").read_text()
        lines = text.splitlines()
        shown[command] = [line for line in lines if re.search(pattern, line)]
    return shown


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "pages",
        nargs="*",
        metavar="PAGE",
        help="such as docs/howto.md (all of the table)",
    )
    parser.add_argument(
        "--all", action="store_true", help="not the quick commands alone"
    )
    parser.add_argument(
        "--draw",
        action="store_true",
        help="with --all: put the pictures and the printed lines of a page where it shows them",
    )
    args = parser.parse_args()
    table = yaml.safe_load(TABLE.read_text())
    with tempfile.TemporaryDirectory() as place:
        shared = None
        for number, (page, entry) in enumerate(table.items()):
            text = (
                script(page, entry, args.all)
                if not args.pages or page in args.pages
                else ""
            )
            if not text:
                continue
            if entry.get("in") == "checkout":
                folder = shared = shared or checkout(Path(place) / "checkout")
            else:
                folder = Path(place) / str(number)
                folder.mkdir()
            print(f"{page}: {run(page, text, folder):.0f} s", flush=True)
            for shown, made in (
                (entry.get("pictures") or {}).items() if args.all else ()
            ):
                if args.draw:
                    shutil.copy(folder / made, ROOT / shown)
                elif not (folder / made).is_file():
                    sys.exit(f"{page}: no {made} was made, which it shows as {shown}")
            printed = read_printed(page, entry, folder) if args.all else {}
            if args.draw:
                content = show_printed((ROOT / page).read_text(), printed)
                (ROOT / page).write_text(content)
            elif printed:
                compare_printed(page, printed)


if __name__ == "__main__":
    main()
