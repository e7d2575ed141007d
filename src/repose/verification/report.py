"""The page, the table and the plots of a run of the verification suite."""

import csv
import html
import io
from collections.abc import Mapping
from pathlib import Path

from matplotlib.figure import Figure

from repose.core.files import write_text
from repose.pictures.figures import style
from repose.pictures.pages import STYLE, page

from .case import KNOWN, MISSED, Result, Row

COLUMNS = (
    "case",
    "quantity",
    "unit",
    "reference",
    "source",
    "result",
    "deviation",
    "tolerance",
    "status",
    "note",
)
COLOURS = (style.BLUE, style.ORANGE, style.GREEN, style.RED, style.SKY, style.PURPLE)
MARKERS = "osD^vP"
MARKS = f"""
td.text, th.text {{ text-align: left; }}
.missed {{ color: {style.RED}; font-weight: bold; }}
.known {{ color: #8a6d00; font-weight: bold; }}
img {{ max-width: 100%; }}
"""


def write(results: Mapping[str, Result], out_dir: str | Path, laws: Mapping[str, str]) -> None:
    """Write index.html, verification.csv and one PNG for each case."""
    out_dir = Path(out_dir)
    _write_csv(results, out_dir / "verification.csv")
    for name, result in results.items():
        if result.panels:
            with style.applied():
                style.save(draw(result), out_dir / f"{name}.png", small_run=False)
    write_text(out_dir / "index.html", _page(results, laws))


def _write_csv(results: Mapping[str, Result], path: Path) -> None:
    """All rows of all cases as a table."""
    lines = io.StringIO(newline="")
    writer = csv.writer(lines)
    writer.writerow(COLUMNS)
    for name, result in results.items():
        for row in result.rows:
            values = [getattr(row, column) for column in COLUMNS[1:]]
            writer.writerow([name, *("" if value is None else value for value in values)])
    write_text(path, lines.getvalue())


def draw(result: Result) -> Figure:
    """The figure of a case that has panels: they stand side by side."""
    figure = style.new_figure(style.PAGE if len(result.panels) > 1 else 1.3 * style.COLUMN, 3.2)
    axes = figure.subplots(1, len(result.panels), squeeze=False)[0]
    for ax, panel in zip(axes, result.panels, strict=True):
        pairs = sum(curve.reference for curve in panel.curves) > 1
        references = results = 0
        for curve in panel.curves:
            if curve.reference:
                colour = COLOURS[references % len(COLOURS)] if pairs else style.BLACK
                references += 1
                ax.plot(curve.x, curve.y, color=colour, label=curve.label, zorder=1)
                continue
            colour, marker = COLOURS[results % len(COLOURS)], MARKERS[results % len(MARKERS)]
            size = 5.0 if results == 0 else 3.0  # so that points that coincide are both seen
            results += 1
            if curve.line:
                ax.plot(curve.x, curve.y, color=colour, ls="-" if results < 3 else "--", label=curve.label)
            else:
                ax.errorbar(
                    curve.x, curve.y, yerr=curve.error, fmt=marker, ms=size, mfc="white", mew=0.9, color=colour,
                    label=curve.label, zorder=2, capsize=2,
                )  # fmt: skip
        ax.set(xlabel=panel.x_label, ylabel=panel.y_label, xscale="log" if panel.log_x else "linear")
        ax.grid(True)
        ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, columnspacing=1.0)
    return figure


def _page(results: Mapping[str, Result], laws: Mapping[str, str]) -> str:
    """The page: how many numbers miss, and a plot and a table of each case."""
    rows = sum(len(result.rows) for result in results.values())
    missed = sum(row.status == MISSED for result in results.values() for row in result.rows)
    known = sum(row.status == KNOWN for result in results.values() for row in result.rows)
    body = [
        "<h1>Verification of the simulator</h1>",
        f"<p>Force laws of every case: {html.escape(', '.join(f'{k} {v}' for k, v in laws.items()))}.</p>",
        f"<p>{len(results)} cases, {rows} numbers: {missed} miss their tolerance, {known} deviate for a reason that "
        "is known and stated. Deviations are relative to the reference; all numbers: "
        '<a href="verification.csv">verification.csv</a>.</p>',
    ]
    for name, result in results.items():
        body.append(f'<h2 id="{name}">{html.escape(result.title)}</h2><p>{html.escape(result.compared)}</p>')
        if result.panels:
            body.append(f'<img src="{name}.png" alt="{html.escape(result.title)}" width="900">')
        body.append(_table(result.rows))
    return page("Verification", "\n".join(body), STYLE + MARKS)


def _number(value: object) -> str:
    """Six digits of a number; a text stays."""
    return value if isinstance(value, str) else "" if value is None else f"{value:.6g}"


def _table(rows: list[Row]) -> str:
    """Rows of a case as an HTML table."""
    head = ("quantity", "unit", "result", "reference", "source", "deviation", "allowed", "status")
    lines = ["<table><tr>" + "".join(f"<th>{name}</th>" for name in head) + "</tr>"]
    for row in rows:
        share = "" if row.deviation is None else f"{100 * row.deviation:.3g} %"
        allowed = "" if row.tolerance is None else f"{100 * row.tolerance:.3g} %"
        marked = {MISSED: "missed", KNOWN: "known"}.get(row.status, "")
        status = row.status + (f": {row.note}" if row.note else "")
        cells = (
            row.quantity,
            row.unit,
            _number(row.result),
            _number(row.reference),
            row.source,
            share,
            allowed,
        )
        text = "".join(f"<td>{html.escape(str(cell))}</td>" for cell in cells)
        lines.append(f'<tr>{text}<td class="text {marked}">{html.escape(status)}</td></tr>')
    return "\n".join([*lines, "</table>"])
