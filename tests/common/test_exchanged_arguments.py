"""No call of a function of the program passes an argument in the place of another one.

An argument has the name of a parameter more often than not. Where that is the name of
another parameter than the one that it is passed to, two arguments have been exchanged.
"""

import ast
import collections
import inspect
from pathlib import Path

import numpy as np
import pytest

from repose.common import places
from repose.common.errors import InputError, YamlError

# Kernels exchange the two bodies of a contact by intention, and share names with callers.
WITHOUT_RULE = ("dem/kernels/", "dem/contact_lists.py")
# Methods of other types have these names, and other parameters.
FOREIGN = {name for kind in (dict, str, Path, np) for name in dir(kind)}
# Calls that pass what has the name of another parameter by intention.
INTENDED = {
    ("bench/reach.py", "convert_to_height"),  # heights of piles, to the height meant
    ("calibrate/study.py", "complete_configuration"),  # the file `content` is read
    ("report/figures/__init__.py", "InputError"),  # the fault is the name of an input
}
# What a refusal names where the fault is in no file.
SOURCES = {
    "berry",
    "berry.json",
    "command line",
    "configuration",
    "environment",
    "figures",
    "installation",
    "next",
    "particle",
    "picture",
    "picture of the pile",
    "report",
    "runs",
    "simulator",
    "study",
    "targets",
}
# Names, and ends of names, of variables that hold a file.
FILES = ("path", "source", "file", "_csv", "_json", "_path", "folder")
REFUSALS = {
    refusal.__name__: list(inspect.signature(refusal).parameters).index("source")
    for refusal in (InputError, YamlError)
}
WITH_CONDITION = ("require_flank",)
TEXT = (ast.Constant, ast.JoinedStr)


def parameters_of(node):
    """Positional parameters of a function, or of the call of a class; None without any."""
    if isinstance(node, ast.FunctionDef):
        names = [part.arg for part in (*node.args.posonlyargs, *node.args.args)]
        return tuple(names[1:] if names[:1] in (["self"], ["cls"]) else names)
    for part in node.body:
        if isinstance(part, ast.FunctionDef) and part.name == "__init__":
            return parameters_of(part)
    return tuple(
        part.target.id
        for part in node.body
        if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name)
    )


def name_of(node):
    """Name of a variable, an attribute or a function."""
    if isinstance(node, ast.Attribute):
        return node.attr.lstrip("_")
    return node.id.lstrip("_") if isinstance(node, ast.Name) else None


def read_sources(sources):
    """Calls with two arguments or more, with their modules; parameters by names of functions."""
    calls = []
    parameters = collections.defaultdict(set)
    for module, text in sources.items():
        for node in ast.walk(ast.parse(text)):
            is_call = isinstance(node, ast.Call) and len(node.args) > 1
            if is_call and name_of(node.func):
                calls.append((module, node))
            is_defined = isinstance(node, ast.FunctionDef | ast.ClassDef)
            if is_defined and node.name != "__init__":
                parameters[node.name.lstrip("_")].add(parameters_of(node))
    return calls, parameters


def is_foreign(function):
    """Whether a method may be that of a type of another library."""
    return isinstance(function, ast.Attribute) and function.attr in FOREIGN


def is_exchanged(call, parameters):
    """Whether an argument has the name of a parameter that gets another one."""
    keywords = {keyword.arg for keyword in call.keywords}
    names = [name_of(argument) for argument in call.args]
    given = dict(zip(parameters, names, strict=False))
    return any(
        name in given and name not in (parameter, given[name], *keywords)
        for parameter, name in given.items()
    )


def is_wrong_refusal(call):
    """Whether a refusal has an entry for the file, a file for the entry, or a text for the condition."""
    function = name_of(call.func)
    if function in WITH_CONDITION and isinstance(call.args[0], TEXT):
        return True
    first = REFUSALS.get(function)
    if first is None or len(call.args) < first + 2:
        return False
    source, key = call.args[first : first + 2]
    if isinstance(source, ast.Constant) and source.value not in SOURCES:
        return True
    return isinstance(key, ast.Name) and key.id.endswith(FILES)


def exchanged_arguments(sources):
    """All calls that are wrong, as `module:line function`."""
    calls, parameters = read_sources(sources)
    return [
        f"{module}:{call.lineno} {function}"
        for module, call in calls
        for function in [name_of(call.func)]
        if (module, function) not in INTENDED and not is_foreign(call.func)
        if is_wrong_refusal(call)
        or (
            parameters[function]
            and all(is_exchanged(call, each) for each in parameters[function])
        )
    ]


def test_no_arguments_are_exchanged():
    modules = {
        path.relative_to(places.PACKAGE).as_posix(): path
        for path in sorted(places.PACKAGE.rglob("*.py"))
    }
    sources = {
        module: path.read_text(encoding="utf-8")
        for module, path in modules.items()
        if not module.startswith(WITHOUT_RULE)
    }
    assert exchanged_arguments(sources) == []


@pytest.mark.parametrize(
    ("line", "is_wrong"),
    [
        ("wait(seconds, 2)", False),
        ("wait(1, job.times)", False),
        ("wait(1, job.seconds)", True),
        ("wait(times, seconds)", True),
        ("self._wait(_times, 2)", True),
        ("Job(path, name)", False),
        ("Job(name, path)", True),
        ("Job(name, 'a')", True),
        ("InputError(path, 'rows', 1, 'two')", False),
        ("InputError('rows', path, 1, 'two')", True),
        ("InputError('rows', 'study', 1, 'two')", True),
        ("InputError(f'jobs of {name}', runs_csv, 1, 'two')", True),
    ],
)
def test_exchanged_arguments_are_found(line, is_wrong):
    definitions = (
        "def wait(seconds, times): ...\nclass Job:\n  path: Path\n  name: str\n"
    )
    found = exchanged_arguments({"a.py": definitions + line})
    assert bool(found) == is_wrong
