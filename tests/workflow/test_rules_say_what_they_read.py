"""The rules: each says what it reads, quotes a user's words, has a caption, and uses no inside of Snakemake."""

import re
import shutil
from types import SimpleNamespace

import jinja2
import pandas as pd
import pytest
from plans import ROOT, snakemake

from repose.common import usage
from repose.config import dependencies
from repose.config.pipeline import PipelineConfig

SHELL = re.compile(r"^( *)shell:\n((?:\1 +.*\n)+)", re.MULTILINE)
RULES = [
    path
    for folder in ("workflow", "research")
    for path in sorted((ROOT / folder).rglob("*.smk"))
]
ODD = """my "bérries"; touch PWNED; 'x' $(touch PWNED) -rf #"""
FIGURE = ("results/figures/figure02.png", "--cores", "1", "--snakefile")
# the caption of a figure is in its entry of the list; tests/report check it
PARAMS = SimpleNamespace(caption="A caption.")
CAPTIONS = sorted((ROOT / "workflow" / "report").glob("*.rst"))
FILES = [
    *RULES,
    *(
        ROOT / name
        for name in ("Snakefile", "workflow/Snakefile", "research/Snakefile")
    ),
]
# Names that Snakemake documents: https://snakemake.readthedocs.io, Writing Workflows.
DOCUMENTED = {"basedir"}
# All rules: no user's file is taken for a result and removed. Snakemake documents no list
# of them (its issues 13 and 792); one by hand would need each name again. The others say
# what the command line gives and whether this process runs one job of another one.
KEPT = {
    "rules",
    "overwrite_configfiles",
    "config_settings",
    "is_main_process",
    "modifier",
    "output_settings",
}
QUICK = ("--cores", "1", "--configfile", "config/quick.yaml")
NAPS = """
rule all:
    input: expand("{i}.txt", i=range(9))

rule one:
    output: "{i}.txt"
    shell: "sleep 0.6; touch {output}"
"""


def test_every_placeholder_is_quoted_and_commands_write_to_the_log():
    placeholders = []
    redirected = set()
    for path in RULES:
        for command in SHELL.finditer(path.read_text()):
            for placeholder in re.findall(r"\{[^}]*\}", command[2]):
                placeholders.append((path.name, placeholder))
            for target in re.findall(r">+ *([^\s\")&]+)", command[2]):
                redirected.add((path.name, target))
    assert len(placeholders) > 200
    unquoted = [
        (name, placeholder)
        for name, placeholder in placeholders
        if not placeholder.endswith(":q}")
    ]
    assert unquoted == []
    assert len(redirected) > 20
    assert {target for _, target in redirected} == {"{log:q}"}, redirected


def test_no_caption_is_left_over():
    text = "".join(
        path.read_text() for path in (ROOT / "workflow" / "rules").rglob("*.smk")
    )
    text += (ROOT / "workflow" / "Snakefile").read_text()
    expected = set(re.findall(r"report/(\w+)\.rst", text))
    assert {path.stem for path in CAPTIONS} == expected


@pytest.mark.essential
@pytest.mark.slow
def test_paths_with_blanks_quotes_and_a_command_in_them_are_one_path_each(tmp_path):
    """Of the working folder, of a configuration and of a table; the first two may have braces and begin with a dash."""
    folder = tmp_path / f"-rf {{x}} {ODD}"
    folder.mkdir()
    shutil.copy(ROOT / "resources/berries.csv", folder / ODD)
    config = f"{{config}} {ODD}.yaml"
    (folder / config).write_text(
        f"berry: {{sizes: '{ODD.replace(chr(39), chr(39) * 2)}'}}\n"
    )
    snakemake(
        folder,
        *FIGURE,
        f"{ROOT}/Snakefile",
        "--configfile",
        f"{ROOT}/config/config.yaml",
        config,
        status=0,
    )
    assert (folder / "results/figures/figure02.png").is_file()
    assert not list(tmp_path.rglob("PWNED"))


@pytest.mark.slow
def test_a_program_in_a_folder_with_braces_is_refused_before_any_work(tmp_path):
    (tmp_path / "{x}").symlink_to(ROOT)
    done = snakemake(tmp_path, *FIGURE, f"{tmp_path}/{{x}}/Snakefile", status=2)
    assert "{x}/Snakefile'; expected a folder without braces" in done.stderr
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize("name", ["config", "quick", "paper"])
def test_every_caption_can_be_filled_in(name, monkeypatch):
    monkeypatch.chdir(ROOT)
    config = PipelineConfig.load(f"config/{name}.yaml").config
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, autoescape=False)
    for path in CAPTIONS:
        text = environment.from_string(path.read_text()).render(
            snakemake=SimpleNamespace(config=config, params=PARAMS)
        )
        assert text.strip(), path.name
        assert "{" not in text, path.name


RULE = re.compile(r"^ *(?:use rule|rule|checkpoint)\b", re.MULTILINE)


def test_each_rule_depends_on_the_settings_of_the_stage_that_it_runs():
    named_stages = set()
    for path in (ROOT / "workflow/rules").rglob("*.smk"):
        for rule in RULE.split(path.read_text()):
            stages = set(re.findall(r"python -m repose (?:stage )?(\w+)", rule))
            named = set(re.findall(r'\bselect_stage_settings\(\s*"(\w+)"', rule))
            assert named <= stages, rule
            named_stages |= named
    assert set(dependencies.STAGE_KEYS) - named_stages == {"measure_silhouette"}


def test_no_inside_is_used_and_functions_are_fewer_than_rules():
    used = set()
    imported = set()
    for path in FILES:
        text = path.read_text()
        used |= set(re.findall(r"(?<![\w/])workflow\.(\w+)", text)) - {"rst", "smk"}
        imported |= set(re.findall(r"(?:from|import) (snakemake[\w.]*)", text))
    assert used - DOCUMENTED == KEPT
    assert imported == {"snakemake.utils"}
    source = "\n".join(
        path.read_text() for path in FILES if "research" not in path.parts
    )
    rules = re.findall(r"^ *(?:rule|checkpoint|use rule)\b.*:$", source, re.MULTILINE)
    assert len(re.findall(r"^ *def ", source, re.MULTILINE)) <= 25 < len(rules)


@pytest.mark.slow
def test_the_profile_looks_seldom_and_a_benchmark_has_the_time_of_the_whole_job(
    tmp_path, project
):
    (line,) = (
        (ROOT / "profiles/default/config.yaml")
        .read_text()
        .split("max-jobs-per-timespan: ")[1:]
    )
    (tmp_path / "Snakefile").write_text(NAPS)
    looks = []
    for arguments in ((), ("--max-jobs-per-timespan", line.split()[0])):
        done = snakemake(
            tmp_path, "--cores", "1", "--verbose", "--forceall", *arguments, status=0
        )
        looks.append(done.stderr.count("Resources before job selection"))
    assert 9 <= looks[1] < 0.7 * looks[0]
    done = snakemake(
        project, "results/quick/design/samples.csv", *QUICK, "--forceall", status=0
    )
    (process,) = usage.list_processes_since(project / "results/quick", 0)
    table = pd.read_csv(project / "results/quick/benchmarks/design.tsv", sep="\t")
    assert process.log == "results/quick/logs/design.log"
    assert 0.3 < table["cpu_time"].item() == pytest.approx(process.cpu_s, abs=0.01)
    assert table["cpu_time"].item() <= done.used_s
