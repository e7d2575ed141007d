"""What the cases share: force laws, and comparisons with known answers."""

import pytest
from verification import page
from verification.case import Case
from verification.laws import LAWS


@pytest.fixture
def laws(request):
    """The force laws of a case, keywords of `Simulation`.

    They are those of the default, or those that the test's parameter names.
    """
    return LAWS[getattr(request, "param", "default")]


@pytest.fixture
def case():
    """Compares results with known answers."""
    return Case()


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem):
    """Compare the lines of a passed case with the page, or give them to its writer."""
    result = yield
    case = pyfuncitem.funcargs.get("case")
    if case is None or pyfuncitem.funcargs["laws"] is not LAWS["default"]:
        return result
    writer = pyfuncitem.config.pluginmanager.get_plugin("page_writer")
    for table, lines in page.lines_of(pyfuncitem.function, case).items():
        if writer is not None:
            writer.lines[table] += lines
        else:
            missing = [line for line in lines if line not in page.read_lines(table)]
            assert not missing, (
                f"{page.PAGE} lacks lines of the table {table!r}, "
                f"write them by `python tests/verification/table.py`: {missing}"
            )
    return result
