"""Templates of decks: filled with any values, they are the decks of these values."""

import math

import pytest
import yaml
from export.jobs import BALL, CONFIG, THREE, job_of
from shared import ROOT

from repose import export
from repose.cli import main
from repose.common.errors import InputError
from repose.config.pipeline import PipelineConfig
from repose.export.template import NUMBER, make_template, write_template
from repose.stages.simulate import draw_seed, fill_template

EXAMPLE = ROOT / "examples" / "lammps_pile"
EXAMPLE_OF_LIGGGHTS = ROOT / "examples" / "liggghts_pile"
FRICTIONS = {"mus_gg": 0.6, "mur_gg": 0.2, "mus_gp": 0.7, "mur_gp": 0.4}


@pytest.fixture(scope="module")
def config():
    return PipelineConfig.load(CONFIG).config


def numbers_of(text):
    return [float(number) for number in NUMBER.findall(text)]


def words_of(text):
    return NUMBER.split(text)[::2]


@pytest.mark.parametrize("particle", [THREE, BALL], ids=["clump", "sphere"])
@pytest.mark.parametrize("program", ["liggghts", "lammps", "yade"])
def test_a_filled_template_is_the_deck(config, program, particle, tmp_path):
    def job_with(values):
        return job_of(config, particle, **values)

    # The template is made at other values than those it is filled with.
    start = job_of(config, particle).parameters
    template, *_ = write_template(
        job_with, start, names=tuple(FRICTIONS), program=program, folder=tmp_path
    )
    filled = fill_template(template.read_text(), start | FRICTIONS, template)
    (deck, expected), *others = export.PROGRAMS[program](job_with(FRICTIONS)).items()
    assert template.name == f"{deck}.j2"
    assert words_of(filled) == words_of(expected)
    assert numbers_of(filled) == pytest.approx(numbers_of(expected), rel=1e-6)
    assert filled != export.PROGRAMS[program](job_with({}))[deck]
    # Other files of the deck stay as they are.
    for name, text in others:
        assert (tmp_path / name).read_text() == text


def test_a_factor_stands_before_the_name():
    def text_of(values):
        return f"limit {2 * values['mu']:.8g}, mu {values['mu']:.8g}, 7"

    template = make_template(text_of, {"mu": 0.3}, ["mu"])
    assert template == "limit {{ 2 * mu }}, mu {{ mu }}, 7"


@pytest.mark.parametrize(
    "text_of",
    [
        lambda values: f"{values['e'] ** 2:.8g}",
        lambda values: "nothing of it 5",
        lambda values: "word" if values["e"] > 0.2 else "other",
        lambda values: "1 2" if values["e"] > 0.2 else "1",
    ],
)
def test_a_parameter_that_the_deck_does_not_hold_in_proportion_is_refused(text_of):
    with pytest.raises(InputError, match="--names is 'e'; expected parameters to"):
        make_template(text_of, {"e": 0.3}, ["e"])


def test_a_number_of_two_parameters_is_refused():
    with pytest.raises(InputError, match="--names is 'b'"):
        make_template(
            lambda values: f"{values['a'] * values['b']}", {"a": 2, "b": 3}, "ab"
        )


def test_an_unknown_name_is_refused(config, tmp_path):
    with pytest.raises(InputError, match=r"--names is 'mu'; expected some of e_gg"):
        write_template(
            lambda values: job_of(config, BALL, **values),
            job_of(config, BALL).parameters,
            names=["mu"],
            program="lammps",
            folder=tmp_path,
        )


@pytest.mark.parametrize(
    ("program", "folder", "files"),
    [
        ("lammps", EXAMPLE, ("in.pour.j2", "grain.mol")),
        ("liggghts", EXAMPLE_OF_LIGGGHTS, ("in.pour.j2", "funnel.stl")),
    ],
)
def test_the_decks_of_the_examples_are_what_export_writes(
    program, folder, files, tmp_path, monkeypatch
):
    monkeypatch.chdir(ROOT)
    words = ["export", "--to", program, "--configfile", str(EXAMPLE / "pile.yaml")]
    words += ["--set", "mus_gg=0.5", "--set", "mur_gg=0.2"]
    words += ["--names", "mus_gg", "mur_gg", "--out", str(tmp_path)]
    assert main(words) == 0
    for name in files:
        assert (tmp_path / name).read_text() == (folder / name).read_text()


def test_a_template_needs_no_values_and_a_deck_does(tmp_path, monkeypatch, capsys):
    """The numbers of a template are names, except those at the centre of a range."""
    monkeypatch.chdir(ROOT)
    words = ["export", "--to", "lammps", "--configfile", str(EXAMPLE / "pile.yaml")]
    words += ["--out", str(tmp_path)]
    assert main([*words, "--names", "mus_gg", "mur_gg"]) == 0
    template = (tmp_path / "in.pour.j2").read_text()
    assert template == (EXAMPLE / "in.pour.j2").read_text()
    capsys.readouterr()
    assert main(words) == 2
    assert capsys.readouterr().err == (
        "repose: error: command line: --card is None; expected the card of a finished "
        "study, or parameters by --set or --samples\n"
    )


def test_each_run_of_liggghts_has_a_prime_as_its_seed():
    """LIGGGHTS refuses other seeds, and those up to 10,000."""
    study = yaml.safe_load((EXAMPLE_OF_LIGGGHTS / "liggghts.yaml").read_text())
    seed_template = study["simulator"]["command"][-1]
    primes = []
    for purpose in ("design", "validation"):
        for sample in range(1, 31):
            for run in range(1, 9):
                seed = draw_seed(1, purpose, sample=sample, run=run)
                prime = int(
                    fill_template(seed_template, {"seed": seed}, "liggghts.yaml")
                )
                assert 0 <= prime - seed < 1000
                primes.append(prime)
    # Neither the runs of a sample nor those of the check repeat a seed.
    assert len(set(primes)) == len(primes)
    small = fill_template(seed_template, {"seed": 5}, "liggghts.yaml")
    assert int(small) == 10_007, "the first prime above 10,000"
    for prime in primes:
        assert prime > 10_000
        assert all(prime % divisor for divisor in range(2, math.isqrt(prime) + 1))
