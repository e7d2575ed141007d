"""Texts that change by intention alone lie in `known/`: `REPOSE_WRITE_KNOWN=1 pytest TEST` writes those of a test."""

import os
import re
from pathlib import Path

import numpy as np

NUMBER = re.compile(r"(?<![\w.])[-+]?\d+\.?\d*(?:e[-+]?\d+)?", re.IGNORECASE)


def is_known(name, text):
    """Hold a text to a file: words exactly, numbers to 1e-5, since processors differ."""
    path = Path(__file__).with_suffix("") / name
    if "REPOSE_WRITE_KNOWN" in os.environ:
        path.write_text(text)
    actual = re.sub(r"[ \n]+", " ", text)
    stored = re.sub(r"[ \n]+", " ", path.read_text())
    assert NUMBER.sub("#", actual) == NUMBER.sub("#", stored)
    np.testing.assert_allclose(
        *(list(map(float, NUMBER.findall(text_))) for text_ in (actual, stored)),
        1e-5,
        1e-12,
    )


def has_known_lines(name, lines):
    """Find every line of a file among these lines; others may be added."""
    path = Path(__file__).with_suffix("") / name
    if "REPOSE_WRITE_KNOWN" in os.environ:
        path.write_text("\n".join(lines) + "\n")
    known = path.read_text().splitlines()
    assert [line for line in known if line not in lines] == []
