"""Hash the code that computes a result, so that an edit of it makes the result again.

A stage depends on its module and on every module of `repose` that it imports, directly
or through others. What cannot change a number is left out of the hash: comments,
format, docstrings, type annotations of functions, what a `raise` statement says, the
meanings of the keys of the configuration, and the captions of figures.
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

# Modules and packages that compute no number. They read and write files, report faults,
# or choose what runs; whoever edits what they do has to force the rules concerned.
WITHOUT_NUMBERS = (
    "repose",
    "repose.cli",
    "repose.common",
    "repose.config",
)
# What is kept between calls has this form; another one is computed anew.
FORMAT = b"3"
DATA = (".csv", ".json", ".mplstyle", ".html", ".js", ".css", ".yaml")
# So many summaries of files are kept: those of some versions of the package.
MOST_SUMMARIES = 1500
# Arguments that explain: of pydantic's `Field`, a key; of `Drawn`, a figure.
MEANING = {
    "Field": ("description", "json_schema_extra"),
    "Drawn": ("title", "caption"),
}
_new_keys: list[str] = []  # of summaries that no earlier call has kept


@cache
def code_hash(*modules: str, follow_imports: bool = True) -> str:
    """Hash the code that modules consist of and depend on.

    Parameters
    ----------
    *modules : str
        Dotted names below `repose` of modules or packages, such as ``stages.dataset``
        or ``measure``. A package stands for all its modules.
    follow_imports : bool, optional
        Whether to include the modules that they import, directly or indirectly.

    Returns
    -------
    str
        16 hexadecimal digits.

    Raises
    ------
    ModuleNotFoundError
        If there is no such module.
    """
    if follow_imports:
        names = dependencies(*modules)
    else:
        names = frozenset(_list_modules(modules))
    digest = hashlib.sha256()
    for name in sorted(names):
        digest.update(f"{name} {_hash_module(name)}\n".encode())
    keep_for_later_calls()
    return digest.hexdigest()[:16]


@cache
def dependencies(*modules: str) -> frozenset[str]:
    """Find all modules that the given modules depend on, including themselves.

    Parameters
    ----------
    *modules : str
        As for `code_hash`.

    Returns
    -------
    frozenset of str
        Full dotted names, without `WITHOUT_NUMBERS`.
    """
    queue = {name for name in _list_modules(modules) if not computes_nothing(name)}
    found_modules: set[str] = set()
    while queue:
        found_modules |= queue
        queue = set().union(*map(_needs, queue)) - found_modules
    return frozenset(found_modules)


def _list_modules(names: Iterable[str]) -> list[str]:
    """List the full names of modules, and of all modules in packages, below `repose`."""
    modules = []
    for name in names:
        modules += _modules_of(f"repose.{name}")
    return modules


@cache
def computes_nothing(module: str) -> bool:
    """Tell whether `WITHOUT_NUMBERS` lists a module, or a package around it."""
    if module in WITHOUT_NUMBERS:
        return True
    packages = (name for name in WITHOUT_NUMBERS if name != "repose")
    return any(module.startswith(f"{package}.") for package in packages)


@cache
def _files() -> dict[str, Path]:
    """Map the full name of each module and package of `repose` to its file."""
    files = {}
    for folder, subfolders, names in os.walk(PACKAGE):
        if "__pycache__" in subfolders:
            subfolders.remove("__pycache__")
        place = Path(folder)
        package = ".".join(("repose", *place.relative_to(PACKAGE).parts))
        for name in names:
            stem, ending = os.path.splitext(name)
            if ending == ".py":
                module = package if stem == "__init__" else f"{package}.{stem}"
                files[module] = place / name
    return files


def _file_of(module: str) -> Path:
    """Find the file of a module or package of `repose`."""
    file = _files().get(module)
    if file is None:
        message = f"{module}: there is no such module in {PACKAGE}"
        raise ModuleNotFoundError(message, name=module)
    return file


def _modules_of(name: str) -> list[str]:
    """List the full dotted names of a module, or of a package and all its modules."""
    is_package = _file_of(name).name == "__init__.py"
    if not is_package:
        return [name]
    inside = f"{name}."
    return [name, *(module for module in _files() if module.startswith(inside))]


@cache
def _needs(module: str) -> frozenset[str]:
    """Find the modules that a module needs directly and that can change a number.

    To import a module, Python also runs the package around it.
    """
    package = module.rpartition(".")[0]
    needed = {package, *_imports(module)}
    return frozenset(name for name in needed if not computes_nothing(name))


def _imports(module: str) -> set[str]:
    """Find the modules of `repose` that a module imports when it runs.

    Imports inside functions count, but not those for type checkers only. An import from
    a package counts for the package, and for the imported name if that is a module. A
    module that imports others by computed names, as a table of laws does, depends on
    its whole package.
    """
    file = _file_of(module)
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    summary = _summarise_file(file)
    names = {_absolute_name(name, level, package) for level, name in summary["imports"]}
    if summary["imports_by_name"]:
        names.update(_modules_of(package))
    return names & _files().keys()


def _absolute_name(name: str, level: int, package: str) -> str:
    """Return the full name of an import: `level` is the number of dots before its name.

    One dot stands for the `package` of the module, and each other dot for the package
    around it.
    """
    if level == 0:
        return name
    parents = package.split(".")
    base = ".".join(parents[: len(parents) - level + 1])
    return f"{base}.{name}" if name else base


class _NumbersOnly(ast.NodeTransformer):
    """Remove from a syntax tree what cannot change a number."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        """Drop docstrings, and other texts that stand alone."""
        is_text = isinstance(node.value, ast.Constant) and isinstance(
            node.value.value, str
        )
        return None if is_text else self.generic_visit(node)

    def visit_Raise(self, node: ast.Raise) -> ast.AST:
        """Keep that something is raised, not what it says."""
        return ast.Raise(exc=None, cause=None)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Drop what explains a key of the configuration, or a figure."""
        if isinstance(node.func, ast.Name):
            meaning = MEANING.get(node.func.id, ())
            node.keywords = [
                keyword for keyword in node.keywords if keyword.arg not in meaning
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
    """Hash the code of a module, and each data file of its folder that it names.

    The result is a text of hashes, separated by blanks.
    """
    file = _file_of(module)
    content = _read(file)
    hashes = [_summarise_file(file)["code"]]
    for name in _data_files(file.parent):
        is_named = name.encode() in content
        if is_named:
            data = (file.parent / name).read_bytes()
            hashes.append(hashlib.sha256(data).hexdigest())
    return " ".join(hashes)


@cache
def _read(file: Path) -> bytes:
    """Read the source code of a module."""
    return file.read_bytes()


@cache
def _data_files(folder: Path) -> list[str]:
    """List the names of the data files in a folder of the package."""
    return sorted(name for name in os.listdir(folder) if name.endswith(DATA))


@cache
def _summarise_file(file: Path) -> dict[str, Any]:
    """Hash the code of a file, and list its imports.

    A file is parsed only once; later calls use the stored summary.

    Returns
    -------
    dict
        ``code``: a hash. ``imports``: pairs of a level and a dotted name; the level is 0
        for an absolute import. ``imports_by_name``: whether the file calls
        `importlib.import_module`.
    """
    content = _read(file)
    key = hashlib.sha256(FORMAT + content).hexdigest()
    summaries = _stored_summaries()
    if key not in summaries:
        summaries[key] = _summarise(content)
        _new_keys.append(key)
    return summaries[key]


def _summarise(content: bytes) -> dict[str, Any]:
    """Parse the content of a file, and return its summary as `_summarise_file` does."""
    tree = ast.parse(content)
    imports: set[tuple[int, str]] = set()
    imports_by_name = False
    for node in _runtime_nodes(tree):
        if isinstance(node, ast.Import):
            imports.update((0, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            # In `from a import b`, b may be a module of the package a, or a name in it.
            origin = node.module or ""
            prefix = f"{origin}." if origin else ""
            imports.add((node.level, origin))
            imports.update((node.level, prefix + alias.name) for alias in node.names)
        elif isinstance(node, ast.Call):
            function = ast.unparse(node.func).rpartition(".")[2]
            if function == "import_module":
                imports_by_name = True

    # Hash the code last, since the visitor changes the tree.
    code = ast.dump(_NumbersOnly().visit(tree))
    return {
        "code": hashlib.sha256(code.encode()).hexdigest(),
        "imports": sorted(imports),
        "imports_by_name": imports_by_name,
    }


def _runtime_nodes(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield the nodes of a module, except those below ``if TYPE_CHECKING:``."""
    queue: list[ast.AST] = [tree]
    while queue:
        node = queue.pop()
        yield node
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            queue.extend(node.orelse)
        else:
            queue.extend(ast.iter_child_nodes(node))


def _store_path() -> Path:
    """Return the file in the user's cache folder that keeps summaries between calls."""
    cache_folder = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache_folder) / "repose" / "source_code.json"


@cache
def _stored_summaries() -> dict[str, dict[str, Any]]:
    """Read the summaries that earlier calls made, by the hash of a file's content.

    They only save time: parsing all modules takes some seconds. A damaged or missing
    file counts as empty.
    """
    try:
        summaries = json.loads(_store_path().read_text(encoding="utf-8"))
    except (OSError, ValueError, RuntimeError):  # RuntimeError: no home folder
        return {}
    return summaries if isinstance(summaries, dict) else {}


def keep_for_later_calls() -> None:
    """Store the new summaries in the cache folder, if it can be written."""
    if not _new_keys:
        return
    try:
        path = _store_path()
        path.parent.mkdir(parents=True, exist_ok=True)
        # Other processes may be reading the file, so replace it in one move.
        part = path.with_name(f"{path.name}.{os.getpid()}.part")
        newest = dict(list(_stored_summaries().items())[-MOST_SUMMARIES:])
        part.write_text(json.dumps(newest), encoding="utf-8")
        part.replace(path)
    except (OSError, RuntimeError):
        return
    _new_keys.clear()
