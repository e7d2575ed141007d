"""What stands in several files about the program, in step."""

import re
import tomllib
from importlib import metadata
from pathlib import Path

import repose

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def names(requirements):
    """Names of distributions in a list of requirements."""
    return {re.match(r"[\w.-]+", line).group().lower() for line in requirements}


def test_the_version_stands_in_the_package_and_its_release_is_listed():
    assert "version" not in PROJECT["project"]
    assert f"## [{repose.__version__}]" in (ROOT / "CHANGELOG.md").read_text()


def test_every_dependency_has_a_range_and_is_pinned_for_the_project():
    extras = PROJECT["project"]["optional-dependencies"]
    wanted = [*PROJECT["project"]["dependencies"], *extras["workflow"], *extras["docs"], *extras["dev"]]
    assert all(re.search("[<>]", line) for line in PROJECT["project"]["dependencies"])
    lines = (ROOT / "environment.txt").read_text().splitlines()
    pins = [line for line in lines if not line.startswith(("#", "-e"))]
    assert all("==" in line for line in pins)
    assert names(wanted) - {"repose-dem"} == names(pins)


def test_the_lock_file_holds_every_pin_with_hashes_and_no_address():
    text = (ROOT / "environment.lock").read_text()
    entries = re.split(r"\n(?=[\w.-]+==)", re.sub(r"^#.*\n", "", text, flags=re.MULTILINE))
    locked = {entry.split()[0].lower() for entry in entries}
    lines = (ROOT / "environment.txt").read_text().splitlines()
    assert {line.lower() for line in lines if not line.startswith(("#", "-e"))} <= locked
    assert all(re.search(r"--hash=sha256:[0-9a-f]{64}\b", entry) for entry in entries)
    assert "://" not in text


def test_the_wheel_holds_what_a_study_reads():
    wheel = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert wheel["sources"] == {"src": "", "docs": "repose/data/docs"}  # `repose docs` reads them
    included = wheel["force-include"]
    assert set(included) == {"Snakefile", "config", "profiles", "resources", "workflow"}
    for source, place in included.items():
        assert (ROOT / source).exists()
        assert place == f"repose/data/{source}"
    assert (ROOT / "src" / "repose" / "py.typed").is_file()


def test_the_pins_lie_in_the_ranges_of_the_wheel():
    from packaging.requirements import Requirement

    for line in PROJECT["project"]["dependencies"]:
        requirement = Requirement(line)
        assert metadata.version(requirement.name) in requirement.specifier
