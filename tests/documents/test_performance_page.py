"""benchmarks/performance_page.py, which writes the tables of docs/performance.md."""

import importlib
import re

import pytest
from shared import ROOT

PAGE = ROOT / "docs/performance.md"
BLOCKS = ("shares", "bound", "scale", "fall")


@pytest.fixture
def performance_page(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    return importlib.import_module("performance_page")


def test_the_page_has_a_place_for_each_table_and_names_the_command(performance_page):
    text = PAGE.read_text()
    found = [name for _, name, _ in performance_page.BLOCK.findall(text)]
    assert found == list(BLOCKS)
    assert "python benchmarks/performance_page.py --large" in text


def test_a_block_is_replaced_alone_and_an_unknown_one_is_refused(performance_page):
    mark = "<!-- benchmarks/performance_page.py: {} -->\n"
    page = f"a\n{mark.format('one')}old\n<!-- end -->\nb\n{mark.format('two')}kept\n<!-- end -->\n"
    text = performance_page.written(page, {"one": "new"})
    assert text == page.replace("old", "\nnew")
    with pytest.raises(SystemExit, match="no place for three"):
        performance_page.written(page, {"three": ""})


def test_the_estimate_is_the_sum_of_its_steps(performance_page, capsys):
    """Two beds of 10 and 20 berries; 100 berries that fall, with one thread and with two."""
    steps = performance_page.scale.REPEATS * performance_page.scale.TIMED_STEPS
    at_rest = 30 * 2 * steps * performance_page.REST_S
    in_fall = (30 * 50 + 2 * 100 * 7) * performance_page.FALL_S
    placed = (30 + 2 * 100) * performance_page.PLACE_S
    found = performance_page.estimate_s(
        [10, 20], [1, 2], falling=100, settle_steps=50, fall_steps=7
    )
    expected = performance_page.COMPILE_S + at_rest + in_fall + placed
    assert found == pytest.approx(expected)
    performance_page.main(["--large", "--estimate"])
    (minutes,) = re.findall(r"about ([\d.]+) minutes", capsys.readouterr().out)
    assert 1 < float(minutes) < 30


@pytest.mark.slow
def test_a_small_run_writes_all_tables(performance_page, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(PAGE.read_text())
    sizes = "--berries 40 80 --shares-of 60 --falling 100 --fall-steps 10"
    small = f"{sizes} --threads 1 2 --settle-steps 300 --rounds 2 --page {page}"
    performance_page.main(small.split())
    text = page.read_text()
    tables = {name: body for _, name, body in blocks_of(text)}
    shares = [float(cell) for cell in re.findall(r"\| (-?\d+) % \|", tables["shares"])]
    # Of each part and of the rest, rounded to percents.
    assert sum(shares) == pytest.approx(100, abs=3)
    bound, engine = re.findall(r"\| ([\d.]+) \| [\d.]+ \|", tables["bound"])
    assert 0 < float(bound) < 1000
    assert float(engine) > 0
    rows = re.findall(r"^\| (\d+) \| (\d) \|", tables["scale"], re.MULTILINE)
    assert rows == [("40", "1"), ("40", "2"), ("80", "1"), ("80", "2")]
    falls = re.findall(r"^\| (\d+) \| (\d) \| (\d+) \|", tables["fall"], re.MULTILINE)
    assert falls == [("100", "1", "10"), ("100", "2", "10")]


def blocks_of(text):
    return re.findall(
        r"(<!-- benchmarks/performance_page\.py: (\w+) -->\n)(.*?)<!-- end -->",
        text,
        re.DOTALL,
    )
