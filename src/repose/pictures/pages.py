"""Tables as pages to read, for the report."""

import html
from pathlib import Path

from repose.core.files import read_table, write_text

STYLE = """
body { font: 14px/1.4 sans-serif; margin: 1.5em; color: #222; }
table { border-collapse: collapse; }
th, td { padding: 0.25em 0.8em; text-align: right; border-bottom: 1px solid #ddd; }
th { border-bottom: 2px solid #555; }
.small-run { color: #b3261e; font-weight: bold; }
"""
SMALL_RUN = "Small run: these numbers show that the chain works and are no calibration."


def write_page(csv_path: str | Path, title: str, out_path: str | Path, small_run: bool = False) -> None:
    """Write a table as an HTML page.

    Parameters
    ----------
    csv_path : path
        The table, a CSV file.
    title : str
        Headline of the page.
    out_path : path
        The page.
    small_run : bool
        Whether the page warns above the table that its numbers are those of a small run.

    Raises
    ------
    InputError
        If the table cannot be read.
    """
    rows = read_table(csv_path).to_html(
        index=False, na_rep="", border=0, float_format=lambda value: f"{value:.4g}"
    )
    note = f'<p class="small-run">{SMALL_RUN}</p>\n' if small_run else ""
    write_text(out_path, page(title, f"<h1>{html.escape(title)}</h1>\n{note}{rows}"))


def page(title: str, body: str, style: str = STYLE) -> str:
    """An HTML page.

    Parameters
    ----------
    title : str
        Plain text.
    body : str
        HTML.
    style : str, optional
        CSS.

    Returns
    -------
    str
        HTML.
    """
    head = f'<meta charset="utf-8"><title>{html.escape(title)}</title><style>{style}</style>'
    return f"<!doctype html>\n<html><head>{head}</head>\n<body>{body}</body></html>\n"
