"""Run all cases of the verification and write their tables into the page.

python tests/verification/table.py
"""

import collections
import os
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


class PageWriter:
    """Collects the lines of all cases and writes the page.

    It is a plugin of pytest named "page_writer"; `conftest.py` hands it the lines.
    """

    def __init__(self):
        self.lines = collections.defaultdict(list)  # by table

    def pytest_sessionfinish(self, exitstatus):
        """Write the page if all cases have passed."""
        from verification import page

        if exitstatus != pytest.ExitCode.OK:
            return
        for table, lines in self.lines.items():
            page.write_lines(table, lines)
            print(f"\n{page.PAGE}: {len(lines)} lines of the table {table!r}")


class Registration:
    """A plugin of pytest that gives the page's writer its name."""

    def pytest_configure(self, config):
        config.pluginmanager.register(PageWriter(), "page_writer")


def main():
    os.chdir(ROOT)
    sys.path[:0] = [str(ROOT / "src"), str(ROOT / "tests")]
    # In one process, with the slow cases and without the tests of the page itself.
    arguments = [
        "tests/verification",
        "-n",
        "0",
        "-m",
        "slow or not slow",
        "--ignore=tests/verification/test_page.py",
    ]
    return pytest.main(arguments, plugins=[Registration()])


if __name__ == "__main__":
    sys.exit(main())
