"""Hash the code that computes a result, so that the workflow notices when it changes.

A stage depends on its module and on every module of `repose` that it imports, directly
or indirectly. The hash leaves out what cannot change a number: comments, format,
docstrings, type annotations of functions, messages of `raise` statements, the meanings
of the keys of the configuration, and the captions of figures.
"""

import ast
import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from repose.common.places import PACKAGE

# Modules and packages that do not compute any numbers. They read and write files,
# report faults, or choose what runs. Editing them makes no rule run again, unless a
# developer forces it.
IGNORED_MODULES = (
    "repose",
    "repose.cli",
    "repose.common",
    "repose.config",
)
# Version of the form in which summaries are stored. Summaries of another version are
# not used.
SUMMARY_FORMAT = b"4"
DATA_SUFFIXES = (".csv", ".json", ".mplstyle", ".html", ".js", ".css", ".yaml")
# Largest number of stored summaries of files: enough for a few versions of the package.
MAX_SUMMARIES = 1500
# Arguments that only explain something: those of pydantic's `Field` explain a key,
# those of `Drawn` a figure.
EXPLAINING_ARGUMENTS = {
    "Field": ("description", "json_schema_extra"),
    "Drawn": ("title", "caption"),
}
# Keys of the summaries that have not been stored yet.
_new_keys: list[str] = []


@cache
def code_hash(*modules: str, follow_imports: bool = True) -> str:
    """Hash the code of modules, and of the modules that they depend on.

    The results of this function and of those that it calls are cached, so a process
    does not notice a change of the code while it runs.

    Parameters
    ----------
    *modules : str
        Dotted names below `repose` of modules or packages, such as ``stages.dataset``
        or ``measure``. A package stands for all its modules.
    follow_imports : bool, optional
        Whether to include all modules that the given modules import, directly or
        indirectly.

    Returns
    -------
    str
        The hash, as 16 hexadecimal digits. Stored results have the same form, so the
        number of digits must not change.

    Raises
    ------
    ModuleNotFoundError
        If there is no such module.
    """
    if follow_imports:
        names = find_dependencies(*modules)
    else:
        names = frozenset(_expand_packages(modules))
    digest = hashlib.sha256()
    for name in sorted(names):
        digest.update(f"{name} {_hash_module(name)}\n".encode())
    # `_hash_module` has parsed files that are new to the cache on disk. Store what was
    # found, so that the next process need not parse them again.
    store_new_summaries()
    return digest.hexdigest()[:16]


@cache
def find_dependencies(*modules: str) -> frozenset[str]:
    """Find all modules that the given modules depend on, including themselves.

    Parameters
    ----------
    *modules : str
        Names of modules or packages without the leading `repose.`, such as
        ``stages.dataset``.

    Returns
    -------
    frozenset of str
        Full names, such as ``repose.stages.dataset``, without `IGNORED_MODULES`.
    """
    new_modules = {name for name in _expand_packages(modules) if not is_ignored(name)}
    found_modules: set[str] = set()
    # In each round, follow the imports of the modules that the previous round found.
    while new_modules:
        found_modules |= new_modules
        needed_modules = set().union(*map(_find_needed_modules, new_modules))
        new_modules = needed_modules - found_modules
    return frozenset(found_modules)


def _expand_packages(names: Iterable[str]) -> list[str]:
    """List the full names of modules, and of all modules in packages.

    The given names are those below `repose`.
    """
    modules = []
    for name in names:
        modules += _list_modules_of(f"repose.{name}")
    return modules


@cache
def is_ignored(module: str) -> bool:
    """Tell whether `IGNORED_MODULES` lists a module, or a package around it."""
    if module in IGNORED_MODULES:
        return True
    packages = (name for name in IGNORED_MODULES if name != "repose")
    return any(module.startswith(f"{package}.") for package in packages)


@cache
def _map_modules_to_files() -> dict[str, Path]:
    """Map the full name of each module and package of `repose` to its file.

    The file of a package is its `__init__.py`.
    """
    files = {}
    for file in PACKAGE.rglob("*.py"):
        parts = file.relative_to(PACKAGE).with_suffix("").parts
        if parts[-1] == "__init__":
            parts = parts[:-1]
        files[".".join(("repose", *parts))] = file
    return files


def _find_file(module: str) -> Path:
    """Find the file of a module or package of `repose`."""
    file = _map_modules_to_files().get(module)
    if file is None:
        message = f"{module}: there is no such module in {PACKAGE}"
        raise ModuleNotFoundError(message, name=module)
    return file


def _list_modules_of(name: str) -> list[str]:
    """List the full dotted names of a module, or of a package and all its modules."""
    is_package = _find_file(name).name == "__init__.py"
    if not is_package:
        return [name]
    inside = f"{name}."
    return [
        name,
        *(module for module in _map_modules_to_files() if module.startswith(inside)),
    ]


@cache
def _find_needed_modules(module: str) -> frozenset[str]:
    """Find the modules that a module needs directly and that can change a number.

    To import a module, Python also runs the package around it.
    """
    package = module.rpartition(".")[0]
    needed = {package, *_find_imported_modules(module)}
    return frozenset(name for name in needed if not is_ignored(name))


def _find_imported_modules(module: str) -> set[str]:
    """Find the modules of `repose` that a module imports when it runs.

    Imports inside functions count, but imports only for type checkers do not. The
    statement ``from a import b`` counts as an import of the package a, and also of the
    module a.b if there is one. Some modules import others by names that they compute.
    Such a module depends on all modules of its package.

    Parameters
    ----------
    module : str
        Full dotted name of a module or package.

    Returns
    -------
    set of str
        Full dotted names.
    """
    file = _find_file(module)
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    summary = _summarise_file(file)
    names = {
        _resolve_import(name, level, package) for level, name in summary["imports"]
    }
    if summary["has_dynamic_imports"]:
        names.update(_list_modules_of(package))

    # Leave out other libraries, and imported names that are not modules.
    return names & _map_modules_to_files().keys()


def _resolve_import(name: str, level: int, package: str) -> str:
    """Return the full name of an imported module.

    Parameters
    ----------
    name : str
        The name in the import statement, without leading dots.
    level : int
        Number of dots before the name; 0 for an absolute import. One dot stands for the
        package of the importing module, and each further dot for the package around it.
    package : str
        The package of the importing module.
    """
    if level == 0:
        return name
    parents = package.split(".")
    base = ".".join(parents[: len(parents) - level + 1])
    return f"{base}.{name}" if name else base


class _NumbersOnly(ast.NodeTransformer):
    """Remove from a syntax tree what cannot change a number."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        """Drop docstrings and other statements that consist only of a string."""
        is_text = isinstance(node.value, ast.Constant) and isinstance(
            node.value.value, str
        )
        return None if is_text else self.generic_visit(node)

    def visit_Raise(self, node: ast.Raise) -> ast.AST:
        """Keep the statement, and drop the exception with its message."""
        return ast.Raise(exc=None, cause=None)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Drop the arguments of `EXPLAINING_ARGUMENTS`."""
        if isinstance(node.func, ast.Name):
            dropped_names = EXPLAINING_ARGUMENTS.get(node.func.id, ())
            node.keywords = [
                keyword for keyword in node.keywords if keyword.arg not in dropped_names
            ]
        return self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        """Drop the annotation of the result."""
        node.returns = None
        return self.generic_visit(node)

    def visit_arg(self, node: ast.arg) -> ast.AST:
        """Drop the annotation of an argument."""
        node.annotation = None
        return node


@cache
def _hash_module(module: str) -> str:
    """Hash the code of a module, and the data files in its folder that it mentions.

    A result depends on the numbers in such a file as well as on the code.

    Parameters
    ----------
    module : str
        Full dotted name.

    Returns
    -------
    str
        Hashes, separated by spaces: first that of the code, then those of the data
        files in alphabetical order. Their order is part of all stored hashes.
    """
    file = _find_file(module)
    content = _read_source(file)
    code_hash_of_file = _summarise_file(file)["code"]
    hashes = [code_hash_of_file]
    for name in _list_data_files(file.parent):
        # The module mentions a data file if the name is anywhere in its source.
        if name.encode() in content:
            data = (file.parent / name).read_bytes()
            hashes.append(hashlib.sha256(data).hexdigest())
    return " ".join(hashes)


@cache
def _read_source(file: Path) -> bytes:
    """Read the source code of a module."""
    return file.read_bytes()


@cache
def _list_data_files(folder: Path) -> list[str]:
    """List the names of the data files in a folder of the package."""
    return sorted(name for name in os.listdir(folder) if name.endswith(DATA_SUFFIXES))


@cache
def _summarise_file(file: Path) -> dict[str, Any]:
    """Hash the code of a file, and list its imports.

    A file is parsed only once. Later calls in the same process use the cache of this
    function, and later processes the summary that `store_new_summaries` has stored.

    Parameters
    ----------
    file : Path
        A Python file of the package.

    Returns
    -------
    dict
        ``code``: a hash of the code. ``imports``: pairs of a level and a dotted name;
        the level is 0 for an absolute import. ``has_dynamic_imports``: whether the file
        calls `importlib.import_module`.
    """
    content = _read_source(file)
    # The key changes with the file and with the form of the summaries. A developer who
    # changes what a summary contains must therefore change `SUMMARY_FORMAT`.
    key = hashlib.sha256(SUMMARY_FORMAT + content).hexdigest()
    summaries = _load_stored_summaries()
    if key not in summaries:
        summaries[key] = _parse_and_summarise(content)
        _new_keys.append(key)
    return summaries[key]


def _parse_and_summarise(content: bytes) -> dict[str, Any]:
    """Parse the content of a file and make its summary, as in `_summarise_file`."""
    tree = ast.parse(content)
    imports = _list_imports(tree)
    has_dynamic_imports = any(map(_is_dynamic_import, _walk_runtime_nodes(tree)))

    # Hash the code last, because the visitor changes the tree.
    code = ast.dump(_NumbersOnly().visit(tree))
    return {
        "code": hashlib.sha256(code.encode()).hexdigest(),
        "imports": imports,
        "has_dynamic_imports": has_dynamic_imports,
    }


def _list_imports(tree: ast.Module) -> list[tuple[int, str]]:
    """List what the statements of a module import when it runs.

    Returns
    -------
    list of (int, str)
        The number of dots before a dotted name, and the name. In ``from a import b``, b
        may be a module of the package a, or a name in it. Both a and a.b are listed,
        and `_find_imported_modules` leaves out what is no module.
    """
    imports: set[tuple[int, str]] = set()
    for node in _walk_runtime_nodes(tree):
        if isinstance(node, ast.Import):
            imports.update((0, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            imported_from = node.module or ""
            prefix = f"{imported_from}." if imported_from else ""
            imports.add((node.level, imported_from))
            imports.update((node.level, prefix + alias.name) for alias in node.names)
    return sorted(imports)


def _is_dynamic_import(node: ast.AST) -> bool:
    """Tell whether a node is a call of `importlib.import_module`."""
    if not isinstance(node, ast.Call):
        return False
    function = ast.unparse(node.func).rpartition(".")[2]
    return function == "import_module"


def _walk_runtime_nodes(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield the nodes of a module, except those below ``if TYPE_CHECKING:``.

    The condition must have exactly this form, as everywhere in this project. The form
    ``typing.TYPE_CHECKING`` is not recognised.
    """
    stack: list[ast.AST] = [tree]
    while stack:
        node = stack.pop()
        yield node
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            # Skip the branch for type checkers, and continue with the `else` branch.
            stack.extend(node.orelse)
        else:
            stack.extend(ast.iter_child_nodes(node))


def _find_store() -> Path:
    """Return the file in the user's cache folder that keeps summaries between calls."""
    cache_folder = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache_folder) / "repose" / "source_code.json"


@cache
def _load_stored_summaries() -> dict[str, dict[str, Any]]:
    """Read the summaries that earlier calls made, by the hash of a file's content.

    Stored summaries save the seconds that it takes to parse all modules. If the file is
    damaged or missing, there are no summaries.
    """
    try:
        summaries = json.loads(_find_store().read_text(encoding="utf-8"))
    except (OSError, ValueError, RuntimeError):
        # Python raises RuntimeError if it cannot find the home folder.
        return {}
    return summaries if isinstance(summaries, dict) else {}


def store_new_summaries() -> None:
    """Store the new summaries in the user's cache folder, for later processes.

    `_summarise_file` has added them to the result of `_load_stored_summaries`, which is
    cached, and their keys to `_new_keys`. If the folder cannot be written, nothing is
    stored. This is no error, because the summaries only save time.
    """
    if not _new_keys:
        return
    try:
        path = _find_store()
        path.parent.mkdir(parents=True, exist_ok=True)
        # Write a new file and rename it, because other processes may be reading the old
        # one.
        new_path = path.with_name(f"{path.name}.{os.getpid()}.part")
        # New summaries are added at the end, so the last ones are the newest.
        newest = dict(list(_load_stored_summaries().items())[-MAX_SUMMARIES:])
        new_path.write_text(json.dumps(newest), encoding="utf-8")
        new_path.replace(path)
    except (OSError, RuntimeError):
        # Python raises RuntimeError if it cannot find the home folder.
        return
    _new_keys.clear()
