"""No text of a user reaches the shell as more than one word."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SHELL = re.compile(r"^( *)shell:\n((?:\1 +.*\n)+)", re.MULTILINE)


RULES = [path for folder in ("workflow", "research") for path in sorted((ROOT / folder).rglob("*.smk"))]


def test_every_placeholder_in_a_shell_command_is_quoted():
    bare, seen = [], 0
    for path in RULES:
        for command in SHELL.finditer(path.read_text()):
            placeholders = re.findall(r"\{[^}]*\}", command[2])
            seen += len(placeholders)
            bare += [f"{path.name}: {placeholder}" for placeholder in placeholders if not placeholder.endswith(":q}")]
    assert seen > 200
    assert not bare


def test_no_shell_command_writes_a_result_itself():
    commands = [(path.name, command[2]) for path in RULES for command in SHELL.finditer(path.read_text())]
    redirected = {(name, one) for name, text in commands for one in re.findall(r">+ *([^\s\")&]+)", text)}
    assert len(redirected) > 20
    assert {one for _, one in redirected} == {"{log:q}"}, redirected


ODD = """my "bérries"; touch PWNED; 'x' $(touch PWNED) -rf #"""


def run_snakemake(folder, snakefile, *words):
    words = ("results/figures/figure02.png", "--cores", "1", "--snakefile", str(snakefile), *words)
    command = [sys.executable, "-m", "snakemake", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True)


@pytest.mark.essential
@pytest.mark.slow
def test_paths_with_blanks_quotes_and_a_command_in_them_are_one_path_each(tmp_path):
    """Of the working folder, of a configuration and of a table; the first two may have braces and begin with a dash."""
    folder = tmp_path / f"-rf {{x}} {ODD}"
    folder.mkdir()
    shutil.copy(ROOT / "resources/berries.csv", folder / ODD)
    config = f"{{config}} {ODD}.yaml"
    (folder / config).write_text(f"berry: {{sizes: '{ODD.replace(chr(39), chr(39) * 2)}'}}\n")
    done = run_snakemake(folder, ROOT / "Snakefile", "--configfile", ROOT / "config/config.yaml", config)
    assert done.returncode == 0, done.stderr
    assert (folder / "results/figures/figure02.png").is_file()
    assert not list(tmp_path.rglob("PWNED"))


@pytest.mark.slow
def test_a_program_in_a_folder_with_braces_is_refused_before_any_work(tmp_path):
    (tmp_path / "{x}").symlink_to(ROOT)
    done = run_snakemake(tmp_path, tmp_path / "{x}/Snakefile")
    assert done.returncode == 2
    assert "{x}/Snakefile'; expected a folder without braces" in done.stderr
    assert not (tmp_path / "results").exists()
