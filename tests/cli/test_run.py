"""`repose run`: what snakemake is given."""

import sys

import pytest

from repose.cli import main, run
from repose.core import places

SNAKEFILE = ["--snakefile", str(places.root() / "Snakefile")]


def test_the_programs_own_workflow_and_all_cores_where_nothing_is_said():
    assert run.snakemake_words([]) == [*SNAKEFILE, "--cores", "all"]


@pytest.mark.parametrize(
    "cores", [["--cores", "2"], ["--cores=2"], ["-c2"], ["-j", "3"], ["--profile", "mine"]]
)
def test_cores_that_are_given_stay(cores):
    assert run.snakemake_words(cores) == [*SNAKEFILE, *cores]


def test_another_snakefile_stays():
    assert run.snakemake_words(["-s", "mine.smk", "-c1"]) == ["-s", "mine.smk", "-c1"]


def test_a_target_behind_the_configuration_is_a_target():
    words = ["--cores", "2", "--configfile", "mine.yaml", "more.yaml", "uncertainty", "-n"]
    expected = ["uncertainty", *SNAKEFILE, "--cores", "2", "--configfile", "mine.yaml", "more.yaml", "-n"]
    assert run.snakemake_words(words) == expected


@pytest.mark.parametrize("words", [["--configfile", "config/quick.yaml"], ["--configfile=config/quick.yaml"]])
def test_a_configuration_that_the_folder_lacks_is_the_programs(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    quick = str(places.root() / "config" / "quick.yaml")
    assert "=".join(run.snakemake_words(["-c1", *words])[3:]) == f"--configfile={quick}"


def test_the_verb_passes_every_word_on_in_its_order(monkeypatch):
    given = []
    monkeypatch.setattr("snakemake.cli.main", given.extend)
    words = ["-n", "--config", "label=mine", "--cores", "1", "--", "berry"]
    assert main(["run", *words]) == 0
    assert given == [*SNAKEFILE, *words]


def test_without_snakemake_the_message_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "snakemake.cli", None)
    assert main(["run"]) == 2
    assert "repose-dem[workflow]" in capsys.readouterr().err


def test_other_verbs_refuse_words_that_they_do_not_know(capsys):
    with pytest.raises(SystemExit) as end:
        main(["check", "--speed", "3"])
    assert end.value.code == 2
    assert "unrecognized arguments: --speed 3" in capsys.readouterr().err
