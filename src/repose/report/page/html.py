"""Pieces of HTML: tables that sort, and pictures inside the page that open large."""

import base64
import html
import io
import math
import os
from collections.abc import Sequence
from pathlib import Path
from string import Template
from typing import Any

import pandas as pd
from PIL import Image, UnidentifiedImageError

from repose.common.errors import InputError
from repose.stages.published import STALE

LONGEST_SIDE_PX = 1600
CSS_DPI, READABLE = (
    96,
    1.1,
)  # the smallest text of a figure, 6 points, then has 9 pixels
WORDS = ("reason", "warning", "status", "role", "line", "source", "wall")


def own(name: str) -> str:
    """Read a file of this folder."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


def fill(name: str, **values: str) -> str:
    """Fill the names of a page's part, a file of this folder."""
    return Template(own(name).removesuffix("\n")).substitute(values)


def text(value: Any) -> str:
    """Write any value as escaped text; four digits for a number, empty for None or NaN."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return f"{value:.4g}" if isinstance(value, float) else html.escape(str(value))


def table(
    head: Sequence[str], rows: Sequence[Sequence[Any]], kind: str = "sorts"
) -> str:
    """Write a table that scrolls sideways on a narrow screen; the class ``sorts`` makes it sortable."""
    kinds, names = (
        [' class="words"' if name in WORDS else "" for name in head],
        [html.escape(name) for name in head],
    )
    cells, body = (
        "".join(f"<th{of}>{name}</th>" for of, name in zip(kinds, names, strict=True)),
        "",
    )
    for row in rows:  # on a phone the style shows the column's name beside its value
        columns = zip(kinds, names, row, strict=True)
        row_cells = "".join(
            f'<td{of} data-head="{name}">{text(value)}</td>'
            for of, name, value in columns
        )
        body += f"<tr>{row_cells}</tr>"
    return f'<div class="wide"><table class="{kind}"><thead><tr>{cells}</tr></thead><tbody>{body}</tbody></table></div>'


def folded(title: str, frame: pd.DataFrame) -> str:
    """Write a table of a study, folded behind its title."""
    rows = frame.astype(object).where(frame.notna(), None).values.tolist()
    shown = table([str(column) for column in frame.columns], rows)
    shown = shown.replace('class="wide"', 'class="wide tall"', 1)
    title += f", {STALE}" if "stale" in frame and frame["stale"].any() else ""
    return f"<details><summary>{html.escape(title)} ({len(frame)} rows)</summary>{shown}</details>"


def picture(path: str | os.PathLike[str] | io.BytesIO, caption: str) -> str:
    """Embed a picture, which opens large; a photograph is reduced. InputError if the file is no picture.

    A figure, whose file has a resolution, is not shrunk below `READABLE` of its size on paper.
    """
    try:
        with Image.open(path) as opened:
            image, dpi = opened.convert("RGB"), opened.info.get("dpi", (0,))[0]
            is_drawing = opened.format == "PNG"
    except (UnidentifiedImageError, FileNotFoundError, IsADirectoryError) as error:
        raise InputError(path, "picture", str(error), "a PNG or JPEG file") from error
    least = round(READABLE * CSS_DPI * image.width / dpi) if is_drawing and dpi else 0
    image.thumbnail((LONGEST_SIDE_PX, LONGEST_SIDE_PX))
    content, kind = io.BytesIO(), "png" if is_drawing else "jpeg"
    if is_drawing:
        image.quantize(128).save(content, "PNG", optimize=True)
    else:
        image.save(content, "JPEG", quality=85)
    source = f"data:image/{kind};base64,{base64.b64encode(content.getvalue()).decode()}"
    size = {"least": str(least), "width": str(image.width), "height": str(image.height)}
    return fill("picture.html", words=html.escape(caption), source=source, **size)
