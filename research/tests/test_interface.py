"""The studies take the package by its documented interface, and by the modules that their README lists."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def modules_taken():
    """Modules of the package that the studies import, each with a file that does."""
    for path in sorted((ROOT / "research").rglob("*.py")):
        if "tests" not in path.parts:
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Import):
                    names = [alias.name for alias in node.names]
                elif isinstance(node, ast.ImportFrom) and node.module:
                    names = [f"{node.module}.{alias.name}" for alias in node.names]
                    names = [name if is_module(name) else node.module for name in names]
                else:
                    continue
                yield from (
                    (name, path.relative_to(ROOT))
                    for name in names
                    if name.split(".")[0] == "repose"
                )


def is_module(name):
    path = ROOT / "src" / name.replace(".", "/")
    return path.is_dir() or path.with_suffix(".py").is_file()


def test_every_module_taken_is_documented_or_listed_with_its_reason():
    documented = re.findall(
        r"automodule:: (\S+)", (ROOT / "docs/reference.md").read_text()
    )
    listed = re.findall(
        r"`(repose\.[\w.]+)`(?=[^|\n]*\|[^|\n]*\|$)",
        (ROOT / "research/README.md").read_text(),
        re.M,
    )
    imported = dict(modules_taken())
    private = {
        name: path
        for name, path in imported.items()
        if name not in {"repose", *documented}
    }
    found = [
        f"{path}: {name}"
        for name, path in private.items()
        if not any(name == room or name.startswith(f"{room}.") for room in listed)
    ]
    found += [
        f"research/README.md: {room} is taken by no study"
        for room in listed
        if not any(name == room or name.startswith(f"{room}.") for name in private)
    ]
    assert not found, "\n".join(found)
