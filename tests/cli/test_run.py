"""`repose run`: what snakemake is given."""

import contextlib
import signal
import subprocess
import sys

import pytest

from repose.calibrate import strategies
from repose.common import places

SNAKEFILE = ["--snakefile", str(places.root() / "Snakefile")]
ALL, WRONG = ["--cores", "all"], "command line: --config is"
QUICK, SLURM = (
    str(places.root() / name) for name in ("config/quick.yaml", "profiles/slurm")
)


@pytest.fixture
def given(monkeypatch):
    words = []
    monkeypatch.setattr("snakemake.cli.main", words.extend)
    return words


def test_words_become_those_of_snakemake(tmp_path, monkeypatch, given, command):
    """All cores where none are given, and files of the program that an empty folder lacks; targets stay in front."""
    monkeypatch.chdir(tmp_path)
    for name in ("mine.yaml", "more.yaml"):
        (tmp_path / name).write_text("label: mine\n")
    cases = {
        "": [*ALL, *SNAKEFILE], **{words: ["--cores", "2", *SNAKEFILE] for words in ("--cores 2", "--cores=2", "-c2")},
        **{words: ["--cores", "2", *SNAKEFILE, "refined"] for words in ("refined -c 2", "--cores 2 refined")},
        "-j 3": ["--jobs", "3", *SNAKEFILE], "--profile mine": ["--profile", "mine", *SNAKEFILE],
        "berry --profile profiles/slurm -n": ["--profile", SLURM, *SNAKEFILE, "berry", "-n"],
        "-s mine.smk -c1": ["--cores", "1", "--snakefile", "mine.smk"],
        "-c1 --configfile config/quick.yaml": ["--configfile", QUICK, "--cores", "1", *SNAKEFILE],
        "-c1 --configfile=config/quick.yaml": ["--configfile", QUICK, "--cores", "1", *SNAKEFILE],
    }  # fmt: skip
    layers = [
        "--configfile",
        "mine.yaml",
        "more.yaml",
        "--cores",
        "2",
        *SNAKEFILE,
        "uncertainty",
        "-np",
    ]
    labelled = [
        "--configfile",
        "mine.yaml",
        "--config",
        "label=mine",
        *ALL,
        *SNAKEFILE,
        "-n",
        "--",
        "berry",
    ]
    cases |= {"uncertainty -c2 --configfile mine.yaml more.yaml -np": layers}
    cases |= {"-n --config label=mine --configfile mine.yaml -- berry": labelled}
    for words, expected in cases.items():
        given.clear()
        command("run", *words.split())
        assert given == expected, words


def test_a_target_that_no_rule_makes_is_named_with_the_nearest(tmp_path):
    (tmp_path / "Snakefile").write_text(
        "rule uncertainty:\n    output: 'one.txt'\n    shell: 'touch {output}'\n"
    )
    call = [sys.executable, "-m", "repose", "run", "uncertanty", "-c1", "-sSnakefile"]
    done = subprocess.run(
        [*call, "--workflow-profile", "none"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    message = "repose: error: command line: target is 'uncertanty'; expected a rule"
    assert message in done.stderr
    assert "did you mean uncertainty?" in done.stderr


def test_without_snakemake_the_message_says_what_to_install(monkeypatch, command):
    monkeypatch.setitem(sys.modules, "snakemake.cli", None)
    assert "repose-dem[workflow]" in command("run", status=2).err


@pytest.mark.parametrize("interrupted", [True, False])
def test_ctrl_c_ends_with_the_sentence_that_says_how_to_go_on_and_another_end_keeps_its_status(
    monkeypatch, command, interrupted
):
    def ended(_words):
        with contextlib.suppress(KeyboardInterrupt):
            if interrupted:
                signal.raise_signal(signal.SIGINT)
        raise SystemExit(1)  # as snakemake ends

    monkeypatch.setattr("snakemake.cli.main", ended)
    before = signal.getsignal(signal.SIGINT)
    said = command(
        "run", "uncertainty", "--cores", "2", status=130 if interrupted else 1
    ).err
    assert (
        ("the same command goes on: repose run uncertainty --cores 2" in said)
        is ("Stopped" in said)
        is interrupted
    )
    assert signal.getsignal(signal.SIGINT) is before


def test_the_list_names_targets_with_their_cost_and_strategies_that_cannot_be(
    command, monkeypatch
):
    out = command("run", "--list", "--configfile", "config/quick.yaml").out
    rules = "".join(
        path.read_text() for path in (places.root() / "workflow").rglob("*.smk")
    )
    named = [
        line.split()[0]
        for line in out.splitlines()
        if line.startswith("  ") and line[2] != " "
    ]
    assert "calibration" in named
    of_strategies = set(strategies.names())  # a rule for each, by its name
    assert all(f"rule {name}:" in rules or name in of_strategies for name in named)
    assert "Studies of quick" in out
    assert {"response_surface", "sequential", "uncertainty"} <= set(named)
    monkeypatch.chdir(places.root() / "crops/wheat")
    assert (
        "not with this configuration: response_surface.surface; expected "
        in command("run", "--list").out
    )


@pytest.mark.parametrize(("words", "message"), [
    (["--configfile", "no_such.yaml"], "no_such.yaml: file is 'No such file or directory'"),
    (["--configfile=config/quick.yaml", "--configfile=bad.yaml"], "bad.yaml: line 1 is"),
    (["--config", "label"], f"{WRONG} 'label'; expected KEY=VALUE"),
    (["--config", "label=a", "uncertainty"], f"{WRONG} 'uncertainty'; expected KEY=VALUE; a target goes before"),
])  # fmt: skip
def test_words_that_snakemake_would_answer_with_a_traceback_are_refused(
    words, message, tmp_path, monkeypatch, command
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.yaml").write_text("a: [")
    monkeypatch.setattr(
        "snakemake.cli.main", lambda _words: pytest.fail("snakemake was called")
    )
    assert f"repose: error: {message}" in command("run", *words, status=2).err


def test_help_shows_the_options_and_other_verbs_refuse_words_that_they_do_not_know(
    command,
):
    shown = command("run", "--help").out
    assert all(
        option in shown for option in ("--configfile", "--config", "--cores", "--list")
    )
    assert (
        "unrecognized arguments: --speed 3"
        in command("check", "--speed", "3", status=2).err
    )
