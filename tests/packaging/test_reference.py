"""The reference shows the documented interface; sphinx refuses a module that is not there."""

import re
from pathlib import Path

from repose import dem
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS

PAGE = (Path(__file__).parents[2] / "docs" / "reference.md").read_text()
SHOWN = set(re.findall(r"^\.\. automodule:: (\S+)$", PAGE, re.MULTILINE))


def test_the_reference_shows_each_public_name_of_the_engine_and_each_law():
    homes = {f"repose.dem.{home}" for home in dem._HOME.values()}
    homes |= {law.kernel.__module__ for law in (*CONTACT_LAWS.values(), *ROLLING_LAWS.values())}
    assert not homes - SHOWN, homes - SHOWN
