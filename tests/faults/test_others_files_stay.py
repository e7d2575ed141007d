"""No verb removes or overwrites a file that the program did not write, whatever its arguments are."""

import io
import json
import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from forked import ROOT, make_up_pours
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from repose.bench import Run
from repose.bench.drum import DrumTest
from repose.cli import STAGES, SUBCOMMANDS, main
from repose.common.errors import InputError
from repose.config.pipeline import PipelineConfig

pytestmark = pytest.mark.slow

# Left out is `run`, which passes its words on to snakemake, whose jobs are the other verbs, and writes nothing. All
# pours and turns of the drum are made up.
LEFT_OUT = {"run"}
FOLDERS = (
    "",
    "results",
    "results/berry",
    "results/design",
    "results/validation",
    "results/pool",
    "thesis",
)
NAMES = (
    "berry.json",
    "berry.stl",
    "summary.csv",
    "particle.json",
    "particles.csv",
    "samples.csv",
    "table4.csv",
    "comparison.csv",
    "dataset.csv",
    "runs.csv",
    "dataset_summary.json",
    "fresh_samples.csv",
    "config.json",
    "figure.png",
    "table.html",
    "silhouette.png",
    "pile.png",
    "snapshot.txt",
    "rounds.csv",
    "o ü.png",
    "heap.npz",
    "heap.pours.json",
    "heap.json",
)
GOOD = {
    "config": "in/config.json",
    "pictures": "in/pile.png",
    "csv": "in/berries.csv",
    "name": "figure02",
    "input": "sizes=in/berries.csv",
    "results": "in/study",
    "title": "Mine",
    "axes": None,
    "berry": "in/made/berry.json",
    "particle": "in/made/particle.json",
    "trajectory": "in/trajectory.npz",
}
READ = ("config", "input", "berry", "particle")
OUT = st.one_of(
    st.sampled_from(
        [
            *filter(None, FOLDERS),
            "..",
            ".",
            "new",
            "new/folder",
            "new.png",
            "-rf",
            "",
            "a b",
            "link",
        ]
    ),
    st.builds(os.path.join, st.sampled_from(FOLDERS), st.sampled_from(NAMES)),
    st.text(alphabet="ab.é '\"{};$*\n", min_size=1, max_size=6),
)


def made_up_turn(_test, scene, **_):
    """A drum that lost its berries: nothing to measure."""
    record = {
        "seed": scene.seed,
        "status": "lost",
        "reason": "made up",
        "rotation_from_s": 1.0,
    }
    return Run(record, {}, {"time_s": np.zeros(1)})


@pytest.fixture(scope="module")
def sandbox(tmp_path_factory):
    """A folder with inputs, links and somebody's files of every name that the program writes, two levels deep."""
    top = tmp_path_factory.mktemp("top")
    work = top / "work"
    for base in (top, work):
        for folder in FOLDERS:
            for name in NAMES:
                path = base / folder / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(f"mine: {folder}/{name}")
    inputs = work / "in"
    inputs.mkdir()
    picture = np.full((120, 300), 230, np.uint8)
    # a triangle on a plain background
    cv2.fillPoly(picture, [np.array([[40, 119], [150, 40], [260, 119]])], 40)
    cv2.imwrite(str(inputs / "pile.png"), picture)
    shutil.copy(ROOT / "resources/berries.csv", inputs)
    for name in ("validation/table4.csv", "dataset.csv"):
        (inputs / "study" / name).parent.mkdir(parents=True, exist_ok=True)
        (inputs / "study" / name).write_text("a\n1\n")
    config = PipelineConfig.load(ROOT / "config/quick.yaml").config
    config["design"] |= {"samples": 12, "method": "lhsdesign"}
    config["measure"] |= {"views": 2, "mm_per_pixel": 0.5}
    (inputs / "config.json").write_text(json.dumps(config))
    (work / "link").symlink_to("thesis/figure.png")
    centres = np.random.default_rng(1).uniform(0.0, 0.05, (2, 5, 3))
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (2, 5, 1))
    times = {"time_s": [0.0, 1.0], "turned_deg": [0.0, 5.0]}
    np.savez(inputs / "trajectory.npz", position=centres, quaternion=turns, **times)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(DrumTest, "run", made_up_turn)
        make_up_pours(patch.setattr)
        patch.chdir(work)
        made = ["--config=in/config.json", "--out=in/made"]
        assert main(["stage", "berry", *made]) == 0
        assert main(["stage", "shape", "--berry=in/made/berry.json", *made]) == 0
        yield top


def tree(top):
    files = (path for path in top.rglob("*") if path.is_symlink() or path.is_file())
    return {
        path: os.readlink(path) if path.is_symlink() else path.read_bytes()
        for path in files
    }


@st.composite
def calls(draw):
    """A verb with good inputs and any place to write to, or with any paths at all."""
    verb = SUBCOMMANDS[draw(st.sampled_from(sorted(set(SUBCOMMANDS) - LEFT_OUT)))]
    good = draw(st.booleans())
    arguments = ["stage", verb.name] if verb.name in STAGES else [verb.name]
    for option in verb.options:
        name = option.names[0]
        keywords = option.keywords
        key = name.lstrip("-").replace("-", "_")
        if key in ("out", "overlay", "stl") and not (key == "stl" and not good):
            arguments += [f"{name}={draw(OUT)}"] if draw(st.booleans()) else []
        elif keywords.get("action") == "store_true":
            arguments += [name] if draw(st.booleans()) else []
        elif key == "mm_per_pixel":
            arguments += ["--mm-per-pixel=0.3"] if good else []
        elif key == "axes":
            arguments += (
                ["--axes", "17", "11", "9", "--mass-g", "1.0"]
                if draw(st.booleans())
                else []
            )
        elif not name.startswith("-") or keywords.get("required") or key in READ:
            value = GOOD.get(key, "in/berries.csv") if good else draw(OUT)
            arguments += [f"{name}={value}"] if name.startswith("-") else [value]
    return arguments


@settings(
    max_examples=80,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    derandomize=True,
)
@given(arguments=calls())
def test_a_verb_leaves_the_files_of_others(sandbox, monkeypatch, arguments):
    before = tree(sandbox)
    monkeypatch.setattr(
        "sys.stdin", io.TextIOWrapper(io.BytesIO(b"what another program prints"))
    )
    try:
        status = main(arguments)
    except SystemExit as end:
        status = end.code
    assert status in (0, 2), arguments
    after = tree(sandbox)
    assert {path: after.get(path) for path in before} == before, arguments
    for path in set(after) - set(before):
        path.unlink()


@pytest.mark.parametrize(
    "arguments",
    [
        ["drum", "--seed=1"],
        ["heap", "--seed=1"],
        ["film", GOOD["trajectory"], "--drum"],
    ],
)
def test_what_is_made_up_ends_well_and_somebodys_file_in_its_place_stays(
    sandbox, arguments
):
    name = arguments[0]
    before = tree(sandbox)
    options = {option.names[0][2:] for option in SUBCOMMANDS[name].options}
    inputs = sorted(options & {*READ} - {"config"})
    arguments = [*arguments, *(f"--{key}={GOOD[key]}" for key in inputs)]
    arguments.append("--config=in/config.json")
    if name in STAGES:
        arguments.insert(0, "stage")
    place = "made_up/a.gif" if name == "film" else "made_up"
    assert main([*arguments, f"--out={place}"]) == 0
    made = set(tree(sandbox)) - set(before)
    assert made
    for path in made:
        path.unlink()
        path.write_text("mine")
    theirs = tree(sandbox)
    assert main([*arguments, f"--out={place}"]) == 2
    assert {path: tree(sandbox).get(path) for path in theirs} == theirs
    for path in set(tree(sandbox)) - set(before):
        path.unlink()


@settings(
    max_examples=100,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    derandomize=True,
)
@given(label=st.text(max_size=70), folder=st.one_of(OUT, st.text(max_size=30)))
def test_a_label_and_a_folder_of_results_lead_nowhere_else(sandbox, label, folder):
    before = tree(sandbox)
    config = PipelineConfig.load("in/config.json").config
    config |= {"label": label, "results_dir": folder}
    config["berry"]["sizes"] = "in/berries.csv"
    try:
        PipelineConfig.of(config).check_inputs()
    except InputError:
        pass
    else:
        snapshot = Path("results/published") / label
        assert (
            snapshot.parent.resolve()
            == Path("results/published").resolve()
            == snapshot.resolve().parent
        )
        place = Path(folder).resolve()
        assert not Path.cwd().is_relative_to(place)
        assert not any(
            place.is_relative_to(Path(forbidden).resolve())
            for forbidden in (".git", ".snakemake", "src")
        )
    assert tree(sandbox) == before
