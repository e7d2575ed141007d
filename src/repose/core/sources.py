"""Hashes of source code: the engine behind a result, and the modules that a stage stands on."""

import ast
import hashlib
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.util import resolve_name
from pathlib import Path

from repose.core.places import PACKAGE

# A pour depends on the simulator, the bench tests, and the sizes of the grains; a test finds what else they import.
ENGINE = ("dem", "apparatus", "particle/particle.py", "particle/size_distribution.py")
# Code that every stage uses; an edit there changes no number of a result.
PLUMBING = ("attached", "errors", "files", "ledger", "lock", "places", "provenance", "section", "sources")
SHARED = ("config", "export", *(f"core.{name}" for name in PLUMBING))


@cache
def engine_hash() -> str:
    """Hash of the source of the simulator and the bench tests, 16 digits."""
    return source_hash(ENGINE)


def source_hash(rooms: Iterable[str]) -> str:
    """Hash of the source of some rooms or files of the package, such as ``dem``, 16 digits."""
    paths = (path for room in rooms for path in [PACKAGE / room, *sorted((PACKAGE / room).rglob("*"))])
    return _hash(path for path in paths if path.suffix in (".py", ".yaml"))


@cache
def stage_hash(verb: str) -> str:
    """Hash, 16 digits, of the modules that a verb uses and of those that they import, except those in `SHARED`."""
    files: set[Path] = set()
    waiting = [path for module in _used_by(verb) for path in _files(module)]
    while waiting:
        path = waiting.pop()
        if path not in files:
            files.add(path)
            waiting += _imported(path)
    return _hash(path for path in sorted(files) if path.parent != PACKAGE / "cli")


def _hash(paths):
    """Hash of the names and contents of files."""
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.relative_to(PACKAGE).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


@cache
def _parsed(path: Path) -> ast.Module:
    """The syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def _imported(path: Path) -> tuple[Path, ...]:
    """Files that a file imports."""
    package = ".".join((PACKAGE.name, *path.relative_to(PACKAGE).parts[:-1]))
    # the engine has a hash of its own, so its modules' relative imports are not followed
    modules = [*_imports(_parsed(path), None if path.is_relative_to(PACKAGE / "dem") else package)]
    if path == PACKAGE / "pictures" / "figures" / "__init__.py":  # imports its modules by their names
        modules += [f"{package}.{beside.stem}" for beside in path.parent.glob("*.py")]
    return tuple(file for module in modules for file in _files(module))


def _used_by(verb: str) -> Iterator[str]:
    """Modules that the function of a verb imports, or takes from the imports and functions of its own module."""
    for path in sorted((PACKAGE / "cli").glob("*.py")):
        known = {
            node.name: node for node in _parsed(path).body if isinstance(node, ast.FunctionDef | ast.ClassDef)
        }
        if verb in known and known[verb].decorator_list:
            break
    else:
        raise LookupError(f"no verb {verb}")
    waiting, seen, names = [verb], set(), set()
    while waiting:
        name = waiting.pop()
        if name in known and name not in seen:
            seen.add(name)
            yield from _imports(known[name])
            used = {node.id for node in ast.walk(known[name]) if isinstance(node, ast.Name)}
            names |= used
            waiting += used
    for node in _parsed(path).body:
        if isinstance(node, ast.ImportFrom) and {alias.asname or alias.name for alias in node.names} & names:
            yield from _imports(node)


def _imports(tree: ast.AST, package: str | None = None) -> Iterator[str]:
    """Names of modules that a syntax tree imports, and names that may be; relative names belong to a package."""
    for node in (tree, *_statements(tree)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and (package or node.level == 0):
            module = resolve_name("." * node.level + (node.module or ""), package)
            yield module
            yield from (f"{module}.{alias.name}" for alias in node.names)


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """All statements below a node: no import is an expression, and there are twenty times as many of them."""
    for part in ("body", "orelse", "finalbody", "handlers", "cases"):
        for inner in getattr(node, part, ()):
            yield inner
            yield from _statements(inner)


@cache
def _files(module: str) -> list[Path]:
    """The file of a module and those of the packages around it; none outside the package or of shared code."""
    steps = module.split(".")
    if steps[0] != PACKAGE.name or len(steps) < 2 or module == "repose.cli":
        return []
    if steps[1] in SHARED or ".".join(steps[1:3]) in SHARED:
        return []
    inside = PACKAGE.joinpath(*steps[1:])
    file = inside.with_suffix(".py")
    if not file.is_file() and not (inside / "__init__.py").is_file():
        return []  # a name inside a module
    around = [PACKAGE.joinpath(*steps[1:k], "__init__.py") for k in range(2, len(steps) + 1)]
    # the command line's own package imports every verb
    return [path for path in (file, *around) if path.is_file() and path != PACKAGE / "cli" / "__init__.py"]
