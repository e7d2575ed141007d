"""Every verb, with each of its files replaced by something that is none, and with options that it cannot take."""

import json
from pathlib import Path

import numpy as np
from shared import ROOT, check_all

from repose.cli import VERBS

BERRY = ROOT / "results/published/recommended/berry"
WRITES = ("out", "overlay", "stl")
OWN = f"--config={Path(__file__).with_name('own.yaml')}"
# The words besides files that a verb needs before it reads any.
NEEDED = {
    "figure": ["figure13"], "measure": ["--mm-per-pixel", "0.1"], "card": ["show"], "export": ["--to", "yade"],
    "new": ["wheat"], "verify": ["--case", "chung1"], **{verb: [OWN] for verb in ("ask", "tell", "calibrate")},
    **{verb: ["--sample", "1"] for verb in ("pour", "heap", "drum")},
}  # fmt: skip
INPUTS_OF_A_FIGURE = ("predictions", "dataset")
GARBAGE = {
    "empty": b"", "binary": bytes(range(256)) * 4, "utf16": '{"label": "x"}'.encode("utf-16"), "null": b"null",
    "list": b"[1, 2]", "number": b"3.5", "cut": b'{"label": "mine", "runs": [{"seed": 1, "sta',
    "header": b"sample,e_gg\n", "zeros": b"\0" * 100,
    "deep": b"[" * 1200,  # above Python's limit of 1000; the time grows with its square
    "words": b"these are only some words\nand more of them, with a comma\n",
}  # fmt: skip
AXES = ["--axes", "17", "11", "9", "--stl=a.stl"]
WRONG_AXES = (["0", "1", "1"], ["-1", "1", "1"], ["nan", "1", "1"], ["inf", "1", "1"], ["9", "11", "17"])
LENGTHS = (
    *("0 1 1 900 1", "-5 1 1 900 1", "nan 1 1 900 1", "100 1 1 900", "100 1 1 900 x", "100 nan 1 900 1"),
    *("100 1 1 1 1", "100 900 1 1 1", "100 1 1 1 900", "1e9 1 1 900 1", "100 1 1 inf 1"),
)
SCALES, DEPTHS = ("mm-per-pixel", "square-mm", "grain-mm"), ("taper", "wrinkles", "wrinkle-depth-mm")
NO_SCALES = ("0", "-1", "nan", "inf", "1e9", "x", "")
WORDS = ("--spheres=0", "--spheres=65", "--spheres=x", "--seed=-1", "--card=a.json", "--sample=1")
BAD_VALUES = (
    *(["check", f"--cores={value}"] for value in ("0", "-1", "many", "1.5")),
    *(["heap", f"--seed={value}"] for value in ("one", "1.5", "nan")),
    *(["heap", "--seeds=2", "--seed=1"], ["heap", "--seeds=100000000"]),
    *(["silhouette", "a.npz", "--particle=b.json", f"--azimuth={value}"] for value in ("nan", "inf", "x")),
    *(["heap", f"--set={value}"] for value in ("", "e_gg=", "=1", "e_gg=0")),
    *(["heap", f"--trajectory={value}"] for value in ("-1", "nan", "1e9", "often")),
    *(["pour", f"--apparatus={value}"] for value in ("", "shaker", "Funnel", "../funnel")),
    *(["pour", "--sample=1"], ["pour", "--samples=x.csv"], ["pour", "--purpose=fun"]),
    *(["berry", "--axes", *axes] for axes in (["1", "2"], ["17", "11", "9"], ["x", "y", "z"])),
    *(["berry", "--axes", *axes, "--mass-g=1", "--stl=a.stl"] for axes in WRONG_AXES),
    *(["berry", *AXES, f"--mass-g={value}"] for value in ("0", "-1", "nan", "inf", "1e9", "x", "1e-9")),
    *(["berry", *AXES, "--mass-g=1", f"--density={value}"] for value in ("0", "-840", "nan", "inf")),
    *(["berry", *AXES, "--mass-g=1", f"--{name}={value}"] for name in DEPTHS for value in ("-1", "nan", "1e6", "x")),
    *(["verify", f"--hits={value}"] for value in ("0", "-5", "x")),
    *(["verify", "--case=no_such_case"], ["verify", "--case="]),
    *(["figure", name, "--out=x.png"] for name in ("", "figure99", "../figure02", "figure02 ")),
    *(["figure", "figure02", f"--input={value}"] for value in ("sizes", "=a", "sizes=", "other=a", "")),
    ["figure", "figure02", "--input=sizes=a", "--input=sizes=b"],
    *(["card", *words] for words in ([], ["show"], ["draw", "a.json"], ["show", "a", "b"], ["compare", "a"])),
    *(["material_card", f"--{name}=a.csv"] for name in ("posterior", "draws")),
    *(["export", *words] for words in ([], ["--to=yade"], ["--to=abaqus", "--set=e_gg=0.3"])),
    *(["export", "--to=yade", "--set=e_gg=0.3", word] for word in WORDS),
    *(["measure", "a.jpg", f"--{name}={value}"] for name in SCALES for value in NO_SCALES),
    *(["measure", "a.jpg", "--length", *value.split()] for value in LENGTHS),
    ["measure", "a.jpg", "--length", "100", "1", "1", "900", "1", "--mm-per-pixel=0.1"],
    ["measure", "a.jpg", "--base-row=300"], ["measure", "a.jpg", "--mm-per-pixel=0.1", "--lens", "b.jpg"],
    *(["measure"], ["measure", "a.jpg"], ["measure", "a.jpg", "b/a.jpg"], ["measure", "a.png", "--out=."]),
    *(["marker", f"--square-mm={value}"] for value in ("0", "-1", "4", "26", "nan", "x")),
    ["marker", "--out=sheet.png"], *([], ["no_such_verb"], ["--no-such-option"], ["Heap"], [""]),
)  # fmt: skip
CARD = ROOT / "crops/cards/wheat.json"
# What these read has its own tests: any file has a provenance, and a report takes files by name.
ELSEWHERE = ("run", "provenance", "report")


def files_of(verb):
    for option in verb.options:
        name, keywords = option.names[0], option.keywords
        key = name.lstrip("-").replace("-", "_")
        plain = keywords.get("type") is None and "action" not in keywords and "choices" not in keywords
        if plain and key not in (*WRITES, "name", "title", "cell", "prefix", "config", "apparatus"):
            yield name, keywords


def call_of(name, path, every=True):
    """Words of a verb with this path for its files; without `every` for those that it needs."""
    words = [name, *NEEDED.get(name, [])]
    for option, keywords in files_of(VERBS[name]):
        if not option.startswith("-"):
            words.append(str(path))
        elif every or keywords.get("required"):
            words.append(f"{option}={path}")
    return words + [f"--input={key}={path}" for key in INPUTS_OF_A_FIGURE if name == "figure"]


READING = sorted(name for name, verb in VERBS.items() if name not in ELSEWHERE and any(files_of(verb)))


def test_verbs_refuse_files_and_configurations_that_they_cannot_read(refused, tmp_path):
    garbage = {kind: tmp_path / f"{kind}.json" for kind in ("missing", "folder", *GARBAGE)}
    garbage["folder"].mkdir()
    for kind, content in GARBAGE.items():
        garbage[kind].write_bytes(content)

    def check(name, path):
        assert path.stem in refused(*call_of(name, path))

    check_all(check, [(f"{name} {kind}", name, path) for name in READING for kind, path in garbage.items()])

    def check(name, config):
        message = refused(*call_of(name, "some_file", every=False), f"--config={config}")
        assert config.stem in message or "some_file" in message

    del garbage["header"]  # a line of text, which YAML takes for a value
    del garbage["deep"]  # every verb reads it by the same function, see test_configuration.py
    check_all(check, [(f"{name} {kind}", name, path) for name in WITH_CONFIG for kind, path in garbage.items()])


WITH_CONFIG = sorted(name for name, verb in VERBS.items() if any("--config" in option.names for option in verb.options))


def test_what_options_are_not_there_or_cannot_take(refused):
    def check(name):
        assert "--no-such-option" in refused(*call_of(name, "some_file", every=False), "--no-such-option")

    check_all(check, [(name, name) for name in sorted(set(VERBS) - {"run"})])
    check_all(lambda words: refused(*words), [(" ".join(words), words) for words in BAD_VALUES])


def test_cards_of_other_studies_or_simulators_and_arrays_of_another_kind_are_refused(refused, tmp_path):
    message = refused(*["export", "--to=edem", f"--card={CARD}"], "--config=config/config.yaml")
    assert f"{CARD}: material is 'wheat'; expected recommended, as in config/config.yaml" in message
    for key in ("grain.density_kg_m3", "grain.shear_modulus_pa", "grain.mean_axes_mm", "wall.poisson_ratio"):
        assert key in message
    card = json.loads(CARD.read_text())
    keep = {key: value for key, value in card.items() if key not in ("grain", "wall", "laws")}
    chance = {"within_1_percent": 0.5, "within_2_percent": 0.5, "inside": 0.5}
    (tmp_path / "card.json").write_text(json.dumps(keep | {"simulator": "EDEM", "probability": chance}))
    assert "simulator is 'EDEM'" in refused("export", "--to=edem", "--card=card.json")
    np.savez(tmp_path / "a.npz", x=np.ones(3))
    (tmp_path / "a.pours.json").write_text(json.dumps({"pours": [{"seed": 1, "status": "ok"}], "sample": 1}))
    berry = [f"--{name}={BERRY / name}.json" for name in ("berry", "particle")]
    assert "position_1" in refused("stage", "measure_runs", "a.pours.json", *berry)
