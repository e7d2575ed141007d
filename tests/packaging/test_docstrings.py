"""Docstrings of the public API are NumPy style: each parameter, the result and the errors have their section.

`numpydoc` has such a check. It stands on an import of each object and brings Sphinx into the tests; the syntax tree is
enough for what is asked here.
"""

import ast
import importlib
import inspect
import operator
import re
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src" / "repose"
# Compiled functions; comments say what their rows hold.
KERNELS = SOURCE / "dem" / "kernels"
MODULES = sorted(path for path in SOURCE.rglob("*.py") if not path.is_relative_to(KERNELS))
FUNCTION = (ast.FunctionDef, ast.AsyncFunctionDef)


def sections(docstring):
    """Lines of each section of a NumPy-style docstring, by its heading."""
    parts = re.split(r"^(\w+)\n-+$", docstring or "", flags=re.MULTILINE)
    return {head: text.splitlines() for head, text in zip(parts[1::2], parts[2::2], strict=True)}


def documented(section):
    """Names that a section of parameters tells, in its order: `low, high : float` tells two."""
    entries = [line.split(" : ")[0] for line in section if line and not line.startswith(" ")]
    return [name.strip().lstrip("*") for entry in entries for name in entry.split(",")]


def parameters(function, own):
    """Names of a function's parameters; `own` are those of the method itself. One that begins with _ is not used."""
    arguments = function.args
    named = [
        *arguments.posonlyargs,
        *arguments.args,
        arguments.vararg,
        *arguments.kwonlyargs,
        arguments.kwarg,
    ]
    return [one.arg for one in named if one and one.arg not in own and not one.arg.startswith("_")]


def statements(function):
    """The function's nodes without those of the functions inside it."""
    nodes = list(function.body)
    for node in nodes:
        yield node
        if not isinstance(node, (*FUNCTION, ast.Lambda, ast.ClassDef)):
            nodes.extend(ast.iter_child_nodes(node))


def gives(function):
    """The section of what a function gives, or None."""
    nodes = list(statements(function))
    if any(isinstance(node, ast.Yield | ast.YieldFrom) for node in nodes):
        return "Yields"
    if function.returns is not None:
        return None if ast.unparse(function.returns) in ("None", "NoReturn") else "Returns"
    values = [node.value for node in nodes if isinstance(node, ast.Return)]
    return "Returns" if any(value is not None for value in values) else None


def raises(function):
    """Whether the function itself raises an error by its name and does not catch it."""
    nodes = list(statements(function))
    tried = [one for node in nodes if isinstance(node, ast.Try) and node.handlers for one in node.body]
    caught = {id(node) for one in tried for node in ast.walk(one)}
    return any(
        isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and id(node) not in caught
        for node in nodes
    )


def docstring(path, name, node):
    """Of a function or class; a method without one has that of the method it overrides, as `help` shows it."""
    own = ast.get_docstring(node)
    if own or "." not in name:
        return own
    module = importlib.import_module(".".join(("repose", *path.relative_to(SOURCE).with_suffix("").parts)))
    return inspect.getdoc(operator.attrgetter(name)(module))


def tells_itself(function):
    """Whether a function is a verb of the command line, told by its options, or a property's setter, by its getter."""
    marks = [ast.unparse(one) for one in function.decorator_list]
    return any(mark.startswith("family.verb(") or mark.endswith(".setter") for mark in marks)


def fields(kind):
    """Names of a dataclass's fields, of a named tuple's, or of the constructor's parameters."""
    for node in kind.body:
        if isinstance(node, FUNCTION) and node.name == "__init__":
            return parameters(node, {"self"})
    marks = [ast.unparse(one) for one in (*kind.decorator_list, *kind.bases)]
    if not any(re.search(r"dataclass|NamedTuple", mark) for mark in marks):
        return []
    named = [node for node in kind.body if isinstance(node, ast.AnnAssign)]
    return [
        node.target.id
        for node in named
        if "ClassVar" not in ast.unparse(node.annotation) and not node.target.id.startswith("_")
    ]


def faults(path):
    """What the docstrings of a module's public functions and classes lack, a line each."""
    found = []
    places = [("", ast.parse(path.read_text()))]
    for prefix, place in places:
        for node in place.body:
            if not isinstance(node, (*FUNCTION, ast.ClassDef)) or node.name.startswith("_"):
                continue
            name = f"{prefix}{node.name}"
            if isinstance(node, ast.ClassDef):
                places.append((f"{name}.", node))
                asked = fields(node)
            elif tells_itself(node):
                continue
            else:
                asked = parameters(node, {"self", "cls"} if prefix else ())
            if not asked:
                continue
            told = sections(docstring(path, name, node))
            heads = ("Parameters", "Attributes") if isinstance(node, ast.ClassDef) else ("Parameters",)
            listed = documented(next((told[head] for head in heads if head in told), ()))
            if sorted(listed) != sorted(asked):
                found.append(
                    f"{name}: Parameters are {', '.join(asked)}; told: {', '.join(listed) or 'none'}"
                )
            if isinstance(node, FUNCTION):
                if gives(node) and gives(node) not in told:
                    found.append(f"{name}: no {gives(node)}")
                if raises(node) and "Raises" not in told:
                    found.append(f"{name}: no Raises")
    return found


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_docstrings_tell_parameters_results_and_errors(path):
    assert faults(path) == []


GOOD = '''
"""A module."""

from dataclasses import dataclass


@dataclass
class Ball:
    """A ball.

    Attributes
    ----------
    radius_m, mass_kg : float
    """

    radius_m: float
    mass_kg: float

    def grown(self, *factors, **_):
        """A larger ball.

        Parameters
        ----------
        *factors : float

        Returns
        -------
        Ball

        Raises
        ------
        ValueError
            Without a factor.
        """
        if not factors:
            raise ValueError("no factor")
        return Ball(max(factors) * self.radius_m, self.mass_kg)
'''


@pytest.mark.parametrize(
    ("old", "new", "missing"),
    [
        ("", "", []),
        (
            "radius_m, mass_kg : float",
            "radius_m : float",
            ["Ball: Parameters are radius_m, mass_kg; told: radius_m"],
        ),
        (
            "        *factors : float",
            "        factor : float",
            ["Ball.grown: Parameters are factors; told: factor"],
        ),
        ("Returns\n        -------", "Gives\n        -----", ["Ball.grown: no Returns"]),
        ("return Ball", "yield Ball", ["Ball.grown: no Yields"]),
        ("Raises\n        ------", "", ["Ball.grown: no Raises"]),
        ("def grown", "def _grown", []),
    ],
)
def test_a_missing_line_is_found(tmp_path, old, new, missing):
    path = tmp_path / "ball.py"
    path.write_text(GOOD.replace(old, new))
    assert faults(path) == missing


def test_an_error_that_is_caught_is_not_asked_for(tmp_path):
    caught = GOOD.replace("if not factors:", "try:").replace(
        'raise ValueError("no factor")',
        'raise ValueError("no factor")\n        except ValueError:\n            factors = (1.0,)',
    )
    path = tmp_path / "ball.py"
    path.write_text(caught.replace("Raises\n        ------", ""))
    assert faults(path) == []
