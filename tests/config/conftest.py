import copy

import pytest

from repose.config.study import Study
from repose.core import places


@pytest.fixture(autouse=True)
def _in_the_project(monkeypatch):
    monkeypatch.chdir(places.root())


@pytest.fixture(scope="session")
def _shipped():
    return Study.load(places.root() / "config/config.yaml").config


@pytest.fixture
def config(_shipped):
    return copy.deepcopy(_shipped)


@pytest.fixture(scope="session")
def quick():
    return Study.load(places.root() / "config/quick.yaml")
