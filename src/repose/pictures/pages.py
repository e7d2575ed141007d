"""Tables as pages to read, for the report."""

import html
from pathlib import Path

import pandas as pd

from repose.core.errors import InputError

STYLE = """
body { font: 14px/1.4 sans-serif; margin: 1.5em; color: #222; }
table { border-collapse: collapse; }
th, td { padding: 0.25em 0.8em; text-align: right; border-bottom: 1px solid #ddd; }
th { border-bottom: 2px solid #555; }
.small-run { color: #b3261e; font-weight: bold; }
"""
SMALL_RUN = "Small run: these numbers show that the chain works and are no calibration."


def write_page(csv_path, title, out_path, small_run=False):
    """Write a CSV as an HTML page; a small run says so above its table. InputError for a bad CSV."""
    try:
        table = pd.read_csv(csv_path)
    except (OSError, ValueError) as error:
        raise InputError(csv_path, "table", str(error), "a CSV file") from error
    rows = table.to_html(index=False, na_rep="", border=0, float_format=lambda value: f"{value:.4g}")
    note = f'<p class="small-run">{SMALL_RUN}</p>\n' if small_run else ""
    head = f'<meta charset="utf-8"><title>{html.escape(title)}</title><style>{STYLE}</style>'
    body = f"<h1>{html.escape(title)}</h1>\n{note}{rows}"
    page = f"<!doctype html>\n<html><head>{head}</head>\n<body>{body}</body></html>\n"
    Path(out_path).parent.mkdir(parents=True, exist_ok=True)
    Path(out_path).write_text(page, encoding="utf-8")
