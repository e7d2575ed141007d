"""docs/verification.md has the line of every case, and of nothing else.

And a case is judged by its tolerances.
"""

import importlib
import inspect
from pathlib import Path

import pytest
from verification import page
from verification.case import Case
from verification.laws import LAWS

FILES = sorted(Path(__file__).parent.glob("test_*.py"))


def case_functions():
    """Give the tests that take a case, in the order of the files and in them."""
    for file in FILES:
        module = importlib.import_module(f"verification.{file.stem}")
        for name, function in vars(module).items():
            if (
                name.startswith("test_")
                and "case" in inspect.signature(function).parameters
            ):
                yield function


def test_the_page_has_a_line_of_every_case_and_of_nothing_else():
    names = [page.case_name(function) for function in case_functions()]
    assert [
        line.split(" | ")[0].strip("| ") for line in page.read_lines(page.CASES)
    ] == names
    assert len(names) == len(set(names)) == 22


@pytest.mark.parametrize("function", list(case_functions()), ids=page.case_name)
def test_no_case_goes_without_the_laws_of_a_study(function):
    laws = LAWS["default"] | {"rolling_law": "none"}
    with pytest.raises(ValueError, match="rolling_law is 'none'"):
        function(Case(), laws)


@pytest.mark.parametrize(
    ("result", "answer", "tolerance"),
    [(1.0029, 1.0, 0.003), (-1.024, -1.0, 0.025), (0.5, 0.5, 0.0)],
)
def test_a_result_within_its_tolerance_passes(result, answer, tolerance):
    case = Case()
    case.close("x", result, answer, tolerance)
    assert case.count == 1
    assert case.largest_deviation == pytest.approx(abs(result / answer - 1.0))


@pytest.mark.parametrize(
    ("check", "numbers"),
    [
        ("close", (1.0031, 1.0)),
        ("near_published", (1.026, 1.0)),
        ("close", (float("nan"), 1.0)),
        ("at_most", (1.1, 1.0)),
        ("at_most", (float("nan"), 1.0)),
        ("within", (0.5, 0.6, 0.7)),
        ("deviates", (1.0, 1.0, 0.1, 0.01)),
        ("deviates", (1.2, 1.0, 0.1, 0.01)),
    ],
)
def test_a_result_beyond_its_tolerance_fails(check, numbers):
    with pytest.raises(AssertionError, match="length"):
        getattr(Case(), check)("length", *numbers)


def test_limits_hold_at_the_limit_and_a_known_deviation_is_listed():
    case = Case()
    case.at_most("x", 1.0, 1.0)
    case.within("x", 0.7, 0.6, 0.7)
    case.deviates("length", 1.1, 1.0, 0.1, 1e-6)
    assert case.count == 3
    assert case.largest_deviation is None
    assert case.known_deviations == ["length: 10 %"]


def test_a_changed_line_fails():
    def test_example():
        """An example."""

    case = Case()
    case.close("x", 1.001, 1.0)
    (line,) = page.lines_of(test_example, case)[page.CASES]
    assert line == "| `test_page.py`: example | An example | 1 | 0.1 % | - | - |"
    assert line not in page.read_lines(page.CASES)
