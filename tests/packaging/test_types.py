"""Every public function tells its types; mypy holds what they say."""

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src" / "repose"
# Compiled functions: numba finds their types.
COMPILED = SOURCE / "dem" / "kernels"
MODULES = sorted(path for path in SOURCE.rglob("*.py") if not path.is_relative_to(COMPILED))


def compiled(function):
    """Whether numba compiles a function."""
    return any("numba.njit" in ast.unparse(decorator) for decorator in function.decorator_list)


def untyped(path):
    """Names of a module's public functions and methods with a parameter or a result that has no type."""
    found = []
    places = [("", ast.parse(path.read_text()))]
    for prefix, place in places:
        for node in place.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.append((f"{node.name}.", node))
            if not isinstance(node, ast.FunctionDef) or node.name.startswith("_") or compiled(node):
                continue
            own = {"self", "cls", "_"} if prefix else {"_"}
            arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            missing = [one for one in arguments if one.arg not in own and one.annotation is None]
            if missing or node.returns is None:
                found.append(f"{prefix}{node.name}")
    return found


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_public_functions_have_types(path):
    assert untyped(path) == []
