"""Every verb, with each of its files replaced by something that is none, and with options that it cannot take."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from shared import ROOT, check_all, written

from repose.cli import SUBCOMMANDS
from repose.config import loader
from repose.config.pipeline import PipelineConfig

BERRY = ROOT / "results/published/goji_berry/berry"
WRITES = ("out", "overlay", "stl")
OWN = f"--configfile={Path(__file__).with_name('own.yaml')}"
# The words besides files that a verb needs before it reads any.
NEEDED = {
    "figure": ["figure13"],
    "measure": ["--mm-per-pixel", "0.1"],
    "card": ["show"],
    "export": ["--to", "yade"],
    "new": ["wheat"],
    **{verb: [OWN] for verb in ("ask", "tell", "calibrate")},
    **{verb: ["--sample", "1"] for verb in ("pour", "heap", "drum")},
    "measure_simulated": ["--out", "results/runs"],
}
INPUTS_OF_A_FIGURE = ("predictions", "dataset")
GARBAGE = {
    "empty": b"",
    "binary": bytes(range(256)) * 4,
    "utf16": '{"label": "x"}'.encode("utf-16"),
    "null": b"null",
    "list": b"[1, 2]",
    "number": b"3.5",
    "cut": b'{"label": "mine", "runs": [{"seed": 1, "sta',
    "header": b"sample,e_gg\n",
    "zeros": b"\0" * 100,
    "deep": b"[" * 1200,  # above Python's limit of 1000; the time grows with its square
    "words": b"these are only some words\nand more of them, with a comma\n",
}
# The card of an earlier version, which has no settings to compare, only values.
CARD = ROOT / "tests/known/card_of_version_0_3.json"
# What these read has its own tests: any file has a provenance, a report takes files by name, and the others need a study
# with a program of the user's own.
ELSEWHERE = ("run", "provenance", "report", "simulate", "measure_simulated")


def files_of(verb):
    for option in verb.options:
        name = option.names[0]
        keywords = option.keywords
        key = name.lstrip("-").replace("-", "_")
        plain = (
            keywords.get("type") is None
            and "action" not in keywords
            and "choices" not in keywords
        )
        if plain and key not in (
            *WRITES,
            "name",
            "title",
            "cell",
            "prefix",
            "configfile",
            "apparatus",
        ):
            yield name, keywords


def call_of(name, path, every=True):
    """Words of a verb with this path for its files; without `every` for those that it needs."""
    arguments = [name, *NEEDED.get(name, [])]
    for option, keywords in files_of(SUBCOMMANDS[name]):
        if not option.startswith("-"):
            arguments.append(str(path))
        elif every or keywords.get("required"):
            arguments.append(f"{option}={path}")
    return arguments + [
        f"--input={key}={path}" for key in INPUTS_OF_A_FIGURE if name == "figure"
    ]


READING = sorted(
    name
    for name, verb in SUBCOMMANDS.items()
    if name not in ELSEWHERE and any(files_of(verb))
)


@pytest.fixture
def with_checked_config(tmp_path, monkeypatch):
    """Adds the configuration to a call, checked before, as the workflow gives it to its stages."""
    # the files that it names are then found from the folder of the calls
    monkeypatch.chdir(tmp_path)
    study = PipelineConfig.load(ROOT / "config/config.yaml")
    path = tmp_path / "results/config.json"
    loader.write_resolved(study.config, path)

    def add(arguments):
        takes_config = not WITH_CONFIG.isdisjoint(arguments[:1])
        if not takes_config or any(word.startswith("--config") for word in arguments):
            return arguments
        return [*arguments, f"--configfile={path}"]

    return add


def test_verbs_refuse_files_and_configurations_that_they_cannot_read(
    refused, tmp_path, with_checked_config
):
    garbage = {
        kind: tmp_path / f"{kind}.json" for kind in ("missing", "folder", *GARBAGE)
    }
    garbage["folder"].mkdir()
    for kind, content in GARBAGE.items():
        garbage[kind].write_bytes(content)

    def check(name, path):
        assert path.stem in refused(*with_checked_config(call_of(name, path)))

    cases = [
        (f"{name} {kind}", name, path)
        for name in READING
        for kind, path in garbage.items()
    ]
    # without a record it gives the start
    check_all(check, [case for case in cases if case[0] != "ask missing"])

    def check(name, config):
        arguments = [
            word for word in call_of(name, "some_file", every=False) if word != OWN
        ]
        message = refused(*arguments, f"--configfile={config}")
        assert config.stem in message or "some_file" in message

    del garbage["header"]  # a line of text, which YAML takes for a value
    del garbage[
        "deep"
    ]  # every verb reads it by the same function, see test_configuration.py
    check_all(
        check,
        [
            (f"{name} {kind}", name, path)
            for name in sorted(WITH_CONFIG)
            for kind, path in garbage.items()
        ],
    )


WITH_CONFIG = {
    name
    for name, verb in SUBCOMMANDS.items()
    if any("--configfile" in option.names for option in verb.options)
}


def test_what_options_are_not_there_or_cannot_take(refused, with_checked_config):
    def check(name):
        assert "--no-such-option" in refused(
            *call_of(name, "some_file", every=False), "--no-such-option"
        )

    check_all(check, [(name, name) for name in sorted(set(SUBCOMMANDS) - {"run"})])
    bad = yaml.safe_load(Path(__file__).with_name("words.yaml").read_text())
    check_all(
        lambda arguments: refused(*with_checked_config(arguments)),
        [(" ".join(arguments), arguments) for arguments in bad],
    )


def test_a_path_that_the_system_refuses_is_a_sentence_with_the_path(refused, tmp_path):
    message = refused("provenance", str(tmp_path))
    assert f"provenance is '{tmp_path}'; expected a file that a subcommand" in message
    name = f"{'a' * 300}.yaml"
    assert f"{name}: file is 'File name too long'; expected a path" in refused(
        "design", f"--configfile={name}"
    )
    (tmp_path / "own.yaml").write_text(Path(OWN.partition("=")[2]).read_text())
    taken = tmp_path / "taken"
    taken.write_text("mine")
    words = ("design", "--config=own.yaml", f"--out={taken}")
    assert f"{taken}: file is 'File exists'; expected a path" in refused(*words)


def test_what_strangers_wrote_is_refused(refused, tmp_path):
    def check(case):
        for name, content in case["files"].items():
            (tmp_path / name).parent.mkdir(exist_ok=True)
            written(tmp_path / name, content)
        assert case["says"] in refused(*case["words"])

    cases = yaml.safe_load(Path(__file__).with_name("strangers.yaml").read_text())
    check_all(check, [(case["says"], case) for case in cases])


def test_cards_of_other_studies_or_simulators_and_arrays_of_another_kind_are_refused(
    refused, tmp_path
):
    message = refused(
        "export", "--to=edem", f"--card={CARD}", "--config=config/config.yaml"
    )
    assert (
        f"{CARD}: material is 'rapeseed'; expected goji_berry, as in config/config.yaml"
        in message
    )
    for key in (
        "grain.density_kg_m3",
        "grain.shear_modulus_pa",
        "grain.mean_axes_mm",
        "wall.poisson_ratio",
    ):
        assert key in message
    card = json.loads(CARD.read_text())
    keep = {
        key: value
        for key, value in card.items()
        if key not in ("grain", "wall", "laws")
    }
    chance = {"within_1_percent": 0.5, "within_2_percent": 0.5, "inside": 0.5}
    (tmp_path / "card.json").write_text(
        json.dumps(keep | {"simulator": "EDEM", "probability": chance})
    )
    assert "simulator is 'EDEM'" in refused("export", "--to=edem", "--card=card.json")
    np.savez(tmp_path / "a.npz", x=np.ones(3))
    (tmp_path / "a.pours.json").write_text(
        json.dumps({"pours": [{"seed": 1, "status": "ok"}], "sample": 1})
    )
    berry = [f"--{name}={BERRY / name}.json" for name in ("berry", "particle")]
    assert "position_1" in refused("stage", "measure_runs", "a.pours.json", *berry)
