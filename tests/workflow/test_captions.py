"""Captions of the report: each names keys that the configurations have."""

from pathlib import Path
from types import SimpleNamespace

import jinja2
import pytest

from repose.config.study import Study

ROOT = Path(__file__).parents[2]
PARAMS = SimpleNamespace(caption="A caption.")  # of a figure: `@figure` says it, and tests/pictures hold it
CAPTIONS = sorted((ROOT / "workflow" / "report").glob("*.rst"))


@pytest.mark.parametrize("name", ["config", "quick", "paper"])
def test_every_caption_can_be_filled_in(name, monkeypatch):
    monkeypatch.chdir(ROOT)
    config = Study.load(f"config/{name}.yaml").config
    words = jinja2.Environment(undefined=jinja2.StrictUndefined, autoescape=False)
    for path in CAPTIONS:
        text = words.from_string(path.read_text()).render(snakemake=SimpleNamespace(config=config, params=PARAMS))
        assert text.strip(), path.name
        assert "{" not in text, path.name


def test_no_caption_is_left_over():
    text = "".join(path.read_text() for path in (ROOT / "workflow" / "rules").rglob("*.smk"))
    text += (ROOT / "workflow" / "Snakefile").read_text()
    unused = [path.stem for path in CAPTIONS if path.stem not in text]
    assert unused == []
