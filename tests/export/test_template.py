"""Templates of decks: filled with any values, they are the decks of these values."""

import pytest
from export.jobs import BALL, CONFIG, THREE, job_of
from shared import ROOT

from repose import export
from repose.cli import main
from repose.common.errors import InputError
from repose.config.pipeline import PipelineConfig
from repose.export.template import NUMBER, template_of, write_template
from repose.stages.simulate import fill

EXAMPLE = ROOT / "examples" / "lammps_pile"
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
    filled = fill(template.read_text(), start | FRICTIONS, template)
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

    template = template_of(text_of, {"mu": 0.3}, ["mu"])
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
        template_of(text_of, {"e": 0.3}, ["e"])


def test_a_number_of_two_parameters_is_refused():
    with pytest.raises(InputError, match="--names is 'b'"):
        template_of(
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


def test_the_deck_of_the_example_is_what_export_writes(tmp_path, monkeypatch):
    monkeypatch.chdir(ROOT)
    words = ["export", "--to", "lammps", "--configfile", str(EXAMPLE / "pile.yaml")]
    words += ["--set", "mus_gg=0.5", "--set", "mur_gg=0.2"]
    words += ["--names", "mus_gg", "mur_gg", "--out", str(tmp_path)]
    assert main(words) == 0
    for name in ("in.pour.j2", "grain.mol"):
        assert (tmp_path / name).read_text() == (EXAMPLE / name).read_text()
