"""Figures that the pages name are drawn, or shown."""

import re

import pytest
from shared import ROOT

from repose.report.figures.catalogue import FIGURES

PAGES = sorted((ROOT / "docs").rglob("*.md"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_page_names_only_figures_that_are_drawn(page):
    named = re.findall(r"`(?:results/)?figures/(\w+)\.png`", page.read_text())
    assert set(named) - {"figureNN"} <= set(FIGURES)


def test_the_figure_of_the_pile_over_the_measurement_is_shown():
    text = (ROOT / "docs/results.md").read_text()
    assert "](../results/published/goji_berry/figures/outline.png)" in text
