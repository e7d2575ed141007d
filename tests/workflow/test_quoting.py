"""No text of a user reaches the shell as more than one word."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SHELL = re.compile(r"^( *)shell:\n((?:\1 +.*\n)+)", re.MULTILINE)


def test_every_placeholder_in_a_shell_command_is_quoted():
    bare, seen = [], 0
    for path in (ROOT / "workflow").rglob("*.smk"):
        for command in SHELL.finditer(path.read_text()):
            placeholders = re.findall(r"\{[^}]*\}", command[2])
            seen += len(placeholders)
            bare += [f"{path.name}: {one}" for one in placeholders if not one.endswith(":q}")]
    assert seen > 200
    assert not bare


@pytest.mark.slow
def test_a_path_with_blanks_quotes_and_a_command_in_it_is_one_path(tmp_path):
    name = """my "bérries"; touch PWNED; 'x' $(touch PWNED) -rf #.csv"""
    shutil.copy(ROOT / "resources/berries.csv", tmp_path / name)
    (tmp_path / "mine.yaml").write_text(f"berry: {{sizes: '{name.replace(chr(39), chr(39) * 2)}'}}\n")
    words = ("results/figures/figure02.png", "--cores", "1", "--configfile", "mine.yaml")
    command = [sys.executable, "-m", "snakemake", *words, "--snakefile", str(ROOT / "Snakefile")]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "results/figures/figure02.png").is_file()
    assert not (tmp_path / "PWNED").exists()
