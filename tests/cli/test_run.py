"""`repose run`: what snakemake is given."""

import signal
import sys

import pytest

from repose import strategies
from repose.cli import main, run
from repose.core import places

SNAKEFILE = ["--snakefile", str(places.root() / "Snakefile")]
PROFILE = [
    *("--workflow-profile", "none", "--scheduler", "greedy", "--logger", "repose"),
    *("--rerun-incomplete", "--show-failed-logs", "--nolock"),
]
OWN = [*SNAKEFILE, *PROFILE]
QUICK, SLURM = (str(places.root() / name) for name in ("config/quick.yaml", "profiles/slurm"))


def test_words_become_those_of_snakemake(tmp_path, monkeypatch):
    """All cores where none are given, and files of the program that an empty folder lacks; a target goes in front."""
    monkeypatch.chdir(tmp_path)
    cases = {
        "": [*OWN, "--cores", "all"],
        "--cores 2": [*OWN, "--cores", "2"],
        "--cores=2": [*OWN, "--cores=2"],
        "-c2": [*OWN, "-c2"],
        "-j 3": [*OWN, "-j", "3"],
        "--profile mine": [*SNAKEFILE, "--profile", "mine"],
        "berry --profile profiles/slurm -n": [*SNAKEFILE, "berry", "--profile", SLURM, "-n"],
        "-s mine.smk -c1": ["-s", "mine.smk", "-c1"],
        "-c1 --configfile config/quick.yaml": [*OWN, "-c1", "--configfile", QUICK],
        "-c1 --configfile=config/quick.yaml": [*OWN, "-c1", f"--configfile={QUICK}"],
        "-c2 --configfile mine.yaml more.yaml uncertainty -n": [
            *("uncertainty", *OWN, "-c2", "--configfile", "mine.yaml", "more.yaml", "-n")
        ],
    }
    assert {words: run.snakemake_arguments(words.split()) for words in cases} == cases
    (tmp_path / "profiles/default").mkdir(parents=True)  # its own profile is left to snakemake
    assert run.snakemake_arguments(["-c1"]) == [*SNAKEFILE, "-c1"]


@pytest.mark.parametrize("words", [["--cores", "2", "refined"], ["-c", "2", "refined"], ["refined", "-c2"]])
def test_a_target_may_stand_behind_the_cores(words):
    run.check_arguments(words)


def test_a_closed_terminal_that_is_ignored_stays_so():
    """As nohup does."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with run._as_interrupts([]):
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
            assert signal.getsignal(signal.SIGTERM) not in (signal.SIG_DFL, signal.SIG_IGN)
        assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    finally:
        signal.signal(signal.SIGHUP, before)


def test_the_verb_passes_every_word_on_in_its_order(monkeypatch):
    given = []
    monkeypatch.setattr("snakemake.cli.main", given.extend)
    words = ["-n", "--config", "label=mine", "--cores", "1", "--", "berry"]
    assert main(["run", *words]) == 0
    assert given == [*OWN, *words]


def test_without_snakemake_the_message_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "snakemake.cli", None)
    assert main(["run"]) == 2
    assert "repose-dem[workflow]" in capsys.readouterr().err


def test_other_verbs_refuse_words_that_they_do_not_know(capsys):
    with pytest.raises(SystemExit) as end:
        main(["check", "--speed", "3"])
    assert end.value.code == 2
    assert "unrecognized arguments: --speed 3" in capsys.readouterr().err


def test_ctrl_c_ends_with_the_sentence_that_says_how_to_go_on(monkeypatch, capsys):
    def interrupted(_words):
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise SystemExit(1) from None  # as snakemake ends

    monkeypatch.setattr("snakemake.cli.main", interrupted)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(SystemExit) as end:
        main(["run", "uncertainty", "--cores", "2"])
    assert end.value.code == 130
    assert "the same command goes on: repose run uncertainty --cores 2" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGINT) is before


def test_a_run_that_ends_by_itself_keeps_its_status(monkeypatch, capsys):
    def ended(_words):
        raise SystemExit(1)

    monkeypatch.setattr("snakemake.cli.main", ended)
    with pytest.raises(SystemExit) as end:
        main(["run"])
    assert end.value.code == 1
    assert "Stopped" not in capsys.readouterr().err


def test_the_list_names_targets_of_the_workflow_with_their_cost(capsys):
    assert main(["run", "--list", "--configfile", "config/quick.yaml"]) == 0
    out = capsys.readouterr().out
    rules = "".join(path.read_text() for path in (places.root() / "workflow").rglob("*.smk"))
    named = [line.split()[0] for line in out.splitlines() if line.startswith("  ") and line[2] != " "]
    assert "calibration" in named
    of_strategies = set(strategies.names())  # a rule for each, by its name
    assert all(f"rule {name}:" in rules or name in of_strategies for name in named)
    assert "Studies of quick" in out
    assert {"response_surface", "sequential", "uncertainty"} <= set(named)


def test_the_list_names_a_strategy_that_the_configuration_cannot_take(monkeypatch, capsys):
    """A crop with two free parameters has too few for a Box-Behnken design."""
    monkeypatch.chdir(places.root() / "crops/wheat")
    assert main(["run", "--list"]) == 0
    assert "not with this configuration: response_surface.surface; allowed: " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--configfile", "no_such.yaml"], "no_such.yaml: file is 'No such file or directory'"),
        (["--configfile=config/quick.yaml", "--configfile=bad.yaml"], "bad.yaml: line 1 is"),
        (["--config", "label"], "command line: --config is 'label'; allowed: KEY=VALUE"),
        (
            ["--config", "label=a", "uncertainty"],
            "command line: --config is 'uncertainty'; allowed: KEY=VALUE; a target goes before",
        ),
        (["uncertainty", "-c", "many"], "command line: -c is 'many'; allowed: a number of cores, or all"),
    ],
)
def test_words_that_snakemake_would_answer_with_a_traceback_are_refused(
    words, message, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.yaml").write_text("a: [")
    monkeypatch.setattr("snakemake.cli.main", lambda _words: pytest.fail("snakemake was called"))
    assert main(["run", *words]) == 2
    assert f"repose: error: {message}" in capsys.readouterr().err


def test_a_target_that_nothing_makes_is_bad_input(monkeypatch, capsys):
    from snakemake.exceptions import MissingRuleException, print_exception

    def missing(_words):
        print_exception(MissingRuleException("nonsense"))
        raise SystemExit(1)

    monkeypatch.setattr("snakemake.cli.main", missing)
    assert main(["run", "nonsense", "-n"]) == 2
    output = capsys.readouterr().err
    assert "repose: error: command line: target is 'nonsense'; allowed: a target" in output
    assert "MissingRuleException" not in output


def test_configurations_are_distinguished_from_targets():
    words = ["results/card.json", "--configfile", "mine.yaml", "more.json", "page", "--cores", "2"]
    assert run.configurations(words) == ["mine.yaml", "more.json"]
    assert run.configurations(["--configfile=mine.yaml", "-n"]) == ["mine.yaml"]
