"""What stands in several files about the program, in step."""

import re
import tomllib
from importlib import metadata
from pathlib import Path

import yaml
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def names(requirements):
    """Names of distributions in a list of requirements."""
    return {re.match(r"[\w.-]+", line).group().lower() for line in requirements}


def test_the_version_stands_in_the_package():
    assert "version" not in PROJECT["project"]
    assert PROJECT["tool"]["hatch"]["version"]["path"] == "src/repose/__init__.py"


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
    assert names(PROJECT["build-system"]["requires"]) <= {entry.split("==")[0] for entry in locked}
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


def test_the_source_distribution_holds_what_the_wheel_is_built_from_and_no_more():
    targets = PROJECT["tool"]["hatch"]["build"]["targets"]
    needed = {*targets["wheel"]["force-include"], "src", *PROJECT["project"]["license-files"]}
    needed |= {"docs", "hatch_build.py"}  # pages of `repose docs`, and the commit of `repose --version`
    assert set(targets["sdist"]["only-include"]) == needed | {"CHANGELOG.md", "CITATION.cff", "README.md"}


def test_a_package_index_shows_the_readme_without_pictures_and_links_into_the_checkout():
    assert PROJECT["project"]["dynamic"] == ["readme", "version"]
    shown = PROJECT["tool"]["hatch"]["metadata"]["hooks"]["fancy-pypi-readme"]
    text = "".join((ROOT / fragment["path"]).read_text() for fragment in shown["fragments"])
    for change in shown["substitutions"]:
        text = re.sub(change["pattern"], change["replacement"], text)
    assert re.findall(r"!?\[[^\]]*\]\((?!https?:)[^)]*\)", text) == []
    assert text.count("\n## ") == (ROOT / "README.md").read_text().count("\n## ")


def test_hosted_checks_run_each_python_of_the_classifiers():
    numbers = [
        line.rpartition(" ")[2] for line in PROJECT["project"]["classifiers"] if ":: Python ::" in line
    ]
    job = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())["jobs"]["checks"]
    assert job["strategy"]["matrix"]["python"] == [number for number in numbers if "." in number]
    assert PROJECT["project"]["requires-python"] == f">={job['strategy']['matrix']['python'][0]}"
    assert job["steps"][-1] == {"run": ".ci/run"}


def test_the_conda_recipe_needs_what_the_package_needs():
    others = {"matplotlib-base": "matplotlib", "py-opencv": "opencv-python-headless"}
    recipe = yaml.safe_load((ROOT / "conda/recipe.yaml").read_text())

    def ranges(lines):
        found = [Requirement(line) for line in lines if not line.startswith("__")]
        return {others.get(one.name, one.name).lower(): one.specifier for one in found}

    extras = PROJECT["project"]["optional-dependencies"]
    python = f"python {PROJECT['project']['requires-python']}"
    assert ranges(recipe["requirements"]["run"]) == ranges([python, *PROJECT["project"]["dependencies"]])
    assert ranges(recipe["requirements"]["host"]) == ranges(
        [python, "pip", *PROJECT["build-system"]["requires"]]
    )
    assert [line.replace("-minimal ", "") for line in recipe["requirements"]["run_constraints"]] == extras[
        "workflow"
    ]
    assert recipe["build"]["python"]["entry_points"] == [
        f"{name} = {place}" for name, place in PROJECT["project"]["scripts"].items()
    ]
    assert (recipe["about"]["summary"], recipe["about"]["license"]) == (
        PROJECT["project"]["description"],
        PROJECT["project"]["license"],
    )


def test_the_pins_lie_in_the_ranges_of_the_wheel():
    for line in PROJECT["project"]["dependencies"]:
        requirement = Requirement(line)
        assert metadata.version(requirement.name) in requirement.specifier
