"""What the distribution says of itself agrees with the project."""

import ast
import datetime
import json
import re
import subprocess
import sys
import tomllib
from importlib import metadata

import yaml
from packaging.requirements import Requirement
from shared import ROOT

import repose
from repose import dem
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
DEPENDENCIES = PROJECT["project"]["dependencies"]
EXTRAS = PROJECT["project"]["optional-dependencies"]
PARTS = [
    line
    for name in ("simulator", "pictures")
    for line in EXTRAS[name]
    if "[" not in line
]
TESTED = [
    *DEPENDENCIES,
    *PARTS,
    *EXTRAS["workflow"],
    *EXTRAS["research"],
    *EXTRAS["test"],
]
PINS = [
    line
    for line in (ROOT / "environment.txt").read_text().splitlines()
    if not line.startswith(("#", "-e"))
]
LOCK = re.sub(
    r"^#.*\n", "", (ROOT / "environment.lock").read_text(), flags=re.MULTILINE
)
# What the extra `workflow` is for: `repose run`, and what is written for calls of snakemake.
RUN = {"cli/run.py", "cli/interruption.py", "common/usage.py"}
# What the extra `vtk` is for.
VTK = {"measure/vtk_files.py"}
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text())
ARCHIVE = json.loads((ROOT / ".zenodo.json").read_text())
AUTHORS = [author["name"] for author in CITATION["authors"]]
PAGE = (ROOT / "docs" / "reference.md").read_text()
SHOWN = set(re.findall(r"^\.\. automodule:: (\S+)$", PAGE, re.MULTILINE))
# `docs/conf.py` shows every module of these packages.
SHOWN_PACKAGES = re.findall(r"^\.\. modules:: (\S+)$", PAGE, re.MULTILINE)
FRONT, PAPER = (ROOT / "paper.md").read_text().removeprefix("---\n").split("\n---\n", 1)


def names(requirements):
    return {re.match(r"[\w.-]+", line).group().lower() for line in requirements} - {
        "repose-dem"
    }


def imported(paths):
    found = set()
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                found.add(node.module.partition(".")[0])
    homes = metadata.packages_distributions()
    theirs = (
        found
        - sys.stdlib_module_names
        - {path.name for path in (ROOT / "src").iterdir()}
    )
    return {
        name.lower().replace("_", "-")
        for module in theirs
        for name in homes.get(module, [module])
    }


def test_every_dependency_is_imported_declared_in_a_range_and_pinned():
    files = {*(ROOT / "src").rglob("*.py")}
    of_run = {ROOT / "src/repose" / name for name in RUN}
    of_vtk = {ROOT / "src/repose" / name for name in VTK}
    needed = imported(files - of_run - of_vtk)
    assert needed == names([*DEPENDENCIES, *PARTS])
    assert imported(of_run) - needed == names(EXTRAS["workflow"])
    assert imported(of_vtk) - needed == names(EXTRAS["vtk"])
    assert "version" not in PROJECT["project"]
    assert PROJECT["tool"]["hatch"]["version"]["path"] == "src/repose/__init__.py"
    assert all(re.search("[<>]", line) for line in DEPENDENCIES)
    assert all("==" in line for line in PINS)
    assert names(TESTED) == names(PINS)


def test_the_lock_file_holds_all_pins_and_tools():
    entries = re.split(r"\n(?=[\w.-]+==)", LOCK)
    locked = {entry.split()[0].lower() for entry in entries}
    assert {line.lower() for line in PINS} <= locked
    tools = [*PROJECT["build-system"]["requires"], *EXTRAS["docs"], *EXTRAS["dev"]]
    assert names(tools) <= {entry.split("==")[0] for entry in locked}
    assert all(re.search(r"--hash=sha256:[0-9a-f]{64}\b", entry) for entry in entries)
    assert "://" not in LOCK


def test_wheel_and_source_distribution_hold_what_they_should():
    targets = PROJECT["tool"]["hatch"]["build"]["targets"]
    wheel = targets["wheel"]
    sdist = targets["sdist"]
    # `repose docs` reads them
    assert wheel["sources"] == {
        "src": "",
        "docs": "repose/data/docs",
    }
    included = wheel["force-include"]
    cards = {
        "crops/cards",
        *(f"results/published/{name}/card.json" for name in ("fast", "goji_berry")),
    }
    expected = {"Snakefile", "config", "profiles", "resources", "workflow"} | cards
    assert set(included) == expected
    for source, place in included.items():
        assert (ROOT / source).exists()
        assert place == f"repose/data/{source}"
    assert (ROOT / "src" / "repose" / "py.typed").is_file()
    needed = {*included, "src", *PROJECT["project"]["license-files"]}
    # pages of `repose docs`, and the commit of `repose --version`
    needed |= {
        "docs",
        "hatch_build.py",
    }
    expected = needed | {
        "CHANGELOG.md",
        "CITATION.cff",
        "README.md",
    }
    assert set(sdist["only-include"]) == expected


def test_the_index_shows_the_readme_and_hosted_checks_run_each_python():
    assert PROJECT["project"]["dynamic"] == ["readme", "version"]
    shown = PROJECT["tool"]["hatch"]["metadata"]["hooks"]["fancy-pypi-readme"]
    text = "".join(
        (ROOT / fragment["path"]).read_text() for fragment in shown["fragments"]
    )
    for change in shown["substitutions"]:
        text = re.sub(change["pattern"], change["replacement"], text)
    assert re.findall(r"!?\[[^\]]*\]\((?!https?:)[^)]*\)", text) == []
    assert text.count("\n## ") == (ROOT / "README.md").read_text().count("\n## ")
    numbers = [
        line.rpartition(" ")[2]
        for line in PROJECT["project"]["classifiers"]
        if ":: Python ::" in line
    ]
    job = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())["jobs"][
        "checks"
    ]
    expected = [number for number in numbers if "." in number]
    assert job["strategy"]["matrix"]["python"] == expected
    expected = f">={job['strategy']['matrix']['python'][0]}"
    assert PROJECT["project"]["requires-python"] == expected
    assert job["steps"][-1] == {"run": ".ci/run"}


def test_the_conda_recipe_needs_what_the_package_needs():
    names_on_pypi = {
        "matplotlib-base": "matplotlib",
        "py-opencv": "opencv-python-headless",
        "snakemake-minimal": "snakemake",
    }
    recipe = yaml.safe_load((ROOT / "conda/recipe.yaml").read_text())

    def ranges(lines):
        """Range of versions of each package, by its name on PyPI."""
        found = {}
        for line in lines:
            # such a line is a virtual package of conda
            if line.startswith("__"):
                continue
            requirement = Requirement(line)
            name = names_on_pypi.get(requirement.name, requirement.name)
            found[name.lower()] = requirement.specifier
        return found

    python = f"python {PROJECT['project']['requires-python']}"
    expected = ranges([python, *DEPENDENCIES, *PARTS])
    assert ranges(recipe["requirements"]["run"]) == expected
    expected = ranges([python, "pip", *PROJECT["build-system"]["requires"]])
    assert ranges(recipe["requirements"]["host"]) == expected
    of_run = [line for line in EXTRAS["workflow"] if not line.startswith("repose-dem")]
    assert ranges(recipe["requirements"]["run_constraints"]) == ranges(of_run)
    section = recipe["about"]
    project = PROJECT["project"]
    scripts = [f"{name} = {place}" for name, place in project["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == scripts
    assert section["summary"] == project["description"]
    assert section["license"] == project["license"]


def test_the_pins_lie_in_the_ranges_of_the_wheel():
    for line in TESTED:
        if not line.startswith("repose-dem"):
            requirement = Requirement(line)
            assert metadata.version(requirement.name) in requirement.specifier


def test_the_reference_shows_each_public_name_of_the_engine_and_each_law():
    homes = {f"repose.dem.{home}" for home in dem._MODULE_OF.values()}
    homes |= {
        law.kernel.__module__
        for law in (*CONTACT_LAWS.values(), *ROLLING_LAWS.values())
    }
    missing = {home for home in homes if home.rpartition(".")[0] not in SHOWN_PACKAGES}
    assert not missing - SHOWN


def test_version_and_date_are_those_of_the_newest_release():
    changelog = (ROOT / "CHANGELOG.md").read_text()
    release = r"^## \[(\d[\d.]*)\] - ([\d-]+)$"
    version, date = re.search(release, changelog, re.MULTILINE).groups()
    recipe = yaml.safe_load((ROOT / "conda/recipe.yaml").read_text())
    assert repose.__version__ == version
    assert CITATION["version"] == version
    assert ARCHIVE["version"] == version
    assert recipe["context"]["version"] == version
    assert CITATION["date-released"] == date
    assert ARCHIVE["publication_date"] == date
    of_paper = datetime.datetime.strptime(yaml.safe_load(FRONT)["date"], "%d %B %Y")
    assert of_paper.date().isoformat() == date


def test_the_archive_says_what_the_citation_says():
    assert ARCHIVE["title"] == CITATION["title"]
    assert ARCHIVE["description"] == CITATION["abstract"]
    assert ARCHIVE["keywords"] == CITATION["keywords"]
    assert ARCHIVE["license"] == CITATION["license"]
    assert ARCHIVE["upload_type"] == CITATION["type"]
    assert [creator["name"] for creator in ARCHIVE["creators"]] == AUTHORS
    cited = [reference["doi"] for reference in CITATION["references"]]
    related = [entry["identifier"] for entry in ARCHIVE["related_identifiers"]]
    assert related == cited


def test_the_paper_has_the_form_of_its_journal_with_references_and_pictures_that_are_there():
    front = yaml.safe_load(FRONT)
    assert front["title"] == CITATION["title"]
    assert [author["name"] for author in front["authors"]] == AUTHORS
    assert {*CITATION["keywords"]} <= {*front["tags"]}
    assert front["bibliography"] == "paper.bib"
    assert re.findall(r"^# (.+)$", PAPER, re.MULTILINE) == [
        "Summary",
        "Statement of need",
        "State of the field",
        "Software design",
        "Quality control",
        "Research impact statement",
        "AI usage disclosure",
        "References",
    ]
    assert 750 <= len(PAPER.split()) <= 1750
    keys = re.findall(r"^@\w+\{(\w+),$", (ROOT / "paper.bib").read_text(), re.MULTILINE)
    assert sorted(keys) == sorted({*re.findall(r"@(\w+)", PAPER)})
    assert all(
        (ROOT / path).is_file() for path in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", PAPER)
    )
    dois = re.findall(r"doi = \{([^}]+)\}", (ROOT / "paper.bib").read_text())
    assert CITATION["references"][0]["doi"] in dois


def test_what_the_owner_has_to_fill_in_is_where_the_page_on_releases_says():
    """No other file that git knows has the words of something that is still to come."""
    pattern = (
        "To fill in once they exist|OWNER/REPOSITORY|TO"
        + "DO|FIX"
        + "ME|example"
        + r"\.(com|org)"
    )
    kinds = [
        f"*.{kind}"
        for kind in ("md", "py", "toml", "cff", "yaml", "yml", "json", "txt", "smk")
    ]
    listed = subprocess.run(
        ["git", "ls-files", *kinds],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    found = {
        path
        for path in listed.splitlines()
        if re.search(pattern, (ROOT / path).read_text(encoding="utf-8"))
    }
    listed_paths = set(
        re.findall(
            r"^\| `([^`]+)` \|", (ROOT / "docs/release.md").read_text(), re.MULTILINE
        )
    )
    expected = listed_paths | {
        "docs/release.md",
        "tests/packaging/test_metadata.py",
        "tests/documents/commands.yaml",
    }
    assert found == expected
