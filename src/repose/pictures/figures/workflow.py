"""Figure 9: the graph of the workflow, from the text that `snakemake --rulegraph` prints."""

import re
import textwrap
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from repose.core.errors import InputError

from . import style

NODE = re.compile(r'^\s*(\w+)\s*\[\s*label\s*=\s*"([^"]*)".*\]', re.M)
EDGE = re.compile(r"^\s*(\w+)\s*->\s*(\w+)", re.M)
SWEEPS = 12
# Width and height of a box, for a distance of 1 between nodes and layers; their distances; letters of a line.
BOX = (0.9, 0.58)
COLUMN_INCH, ROW_INCH = 1.15, 0.62
LINE = 15
LARGEST_SIZE = 8.5
NAMES = {"miga": "search (MIGA)"}  # in place of a rule's own


def read_dot(path: str | Path) -> tuple[dict[str, str], list[tuple[str, str]]]:
    """Labels by node, and the sorted edges (from, to) of a rule graph in the DOT language."""
    text = Path(path).read_text()
    labels = {node: label.replace("\\n", "\n") for node, label in NODE.findall(text)}
    if not labels:
        raise InputError(path, "graph", "no nodes", "the output of snakemake --rulegraph")
    edges = sorted({(a, b) for a, b in EDGE.findall(text) if a in labels and b in labels and a != b})
    return labels, edges


def reduced(edges: Sequence[tuple]) -> list[tuple]:
    """The edges (from, to) of an acyclic graph without edges that a longer path implies, in the same order."""
    after: dict[Any, set] = {}
    for a, b in edges:
        after.setdefault(a, set()).add(b)

    def reach(node: Any, skip: Any) -> set:
        seen, stack = set(), [n for n in after.get(node, ()) if n != skip]
        while stack:
            n = stack.pop()
            if n not in seen:
                seen.add(n)
                stack.extend(after.get(n, ()))
        return seen

    return [(a, b) for a, b in edges if b not in reach(a, b)]


def layers_of(nodes: Sequence, edges: Sequence[tuple]) -> dict[Any, int]:
    """Layer of each node, from 0: the number of edges on the longest path to it; InputError for a cycle."""
    layer = dict.fromkeys(nodes, 0)
    for _ in range(len(layer) + 1):
        moved = False
        for a, b in edges:
            if layer[b] <= layer[a]:
                layer[b], moved = layer[a] + 1, True
        if not moved:
            return layer
    raise InputError("rule graph", "edges", "a cycle", "a graph without cycles")


def layout(nodes: Sequence, edges: Sequence[tuple]) -> tuple[dict, dict]:
    """Places (x, layer) of a graph's nodes, and the places that each edge passes; InputError for a cycle.

    Edges over several layers pass through stand-ins; a layer is ordered by the mean place of its neighbours. Nodes of a
    layer are at least 1 apart.
    """
    layer = layers_of(nodes, edges)
    rows = [[n for n in nodes if layer[n] == k] for k in range(max(layer.values()) + 1)]
    ways, links = {}, []
    for a, b in edges:
        way = [a] + [(a, b, k) for k in range(layer[a] + 1, layer[b])] + [b]
        for stand_in in way[1:-1]:
            rows[stand_in[2]].append(stand_in)
        ways[a, b] = way
        links += list(pairwise(way))
    place = {n: i - (len(row) - 1) / 2 for row in rows for i, n in enumerate(row)}
    for sweep in range(SWEEPS):
        for row in rows if sweep % 2 == 0 else rows[::-1]:
            wish = {n: _mean_neighbour(n, links, place) for n in row}
            row.sort(key=lambda n: wish[n])
            for n, x in zip(row, _spread([wish[n] for n in row]), strict=True):
                place[n] = x
    where = {n: (place[n], k) for k, row in enumerate(rows) for n in row}
    return {n: where[n] for n in nodes}, {edge: [where[n] for n in way] for edge, way in ways.items()}


def _mean_neighbour(node: Any, links: Sequence, place: Mapping) -> float:
    """Mean place of the nodes that are linked with a node; its own place without links."""
    others = [place[a] for a, b in links if b == node] + [place[b] for a, b in links if a == node]
    return float(np.mean(others)) if others else place[node]


def _spread(wishes: Sequence[float]) -> list[float]:
    """Places at least 1 apart, in order, as near to the sorted wishes as a shift of the row allows."""
    places: list[float] = []
    for wish in wishes:
        places.append(wish if not places else max(wish, places[-1] + 1.0))
    shift = float(np.mean(wishes) - np.mean(places))
    return [p + shift for p in places]


def rule_graph(inputs: Mapping[str, Any], config: Mapping[str, Any]) -> Figure:
    """Figure 9 of the paper: rules as boxes from top to bottom, arrows along the data; implied arrows are left out."""
    labels, edges = read_dot(inputs["dot"])
    edges = reduced(edges)
    places, ways = layout(list(labels), edges)
    depth = max(y for _, y in places.values()) + 1
    across = [x for way in ways.values() for x, _ in way] + [x for x, _ in places.values()]
    left, right = min(across) - 0.52, max(across) + 0.52
    figure = style.new_figure(
        min(style.PAGE, max(style.COLUMN, COLUMN_INCH * (right - left))), ROW_INCH * depth + 0.1
    )
    panel = figure.subplots()
    for way in ways.values():
        _arrow(panel, np.array(way, float))
    width, height = (72 * BOX[0] * figure.get_figwidth() / (right - left), 72 * BOX[1] * ROW_INCH)
    for node, (x, y) in places.items():
        corner = (x - BOX[0] / 2, y - BOX[1] / 2)
        look = {"boxstyle": "round,pad=0,rounding_size=0.08", "fc": "#E8F1F8", "ec": style.BLUE, "zorder": 3}
        panel.add_patch(FancyBboxPatch(corner, *BOX, **look))
        words = textwrap.fill(NAMES.get(labels[node], labels[node]).replace("_", " "), LINE)
        size = _size_that_fits(words, width, height)
        panel.text(x, y, words, ha="center", va="center", fontsize=size, linespacing=1.1, zorder=4)
    panel.set(xlim=(left, right), ylim=(depth - 0.6, -0.4))
    panel.axis("off")
    return figure


def _size_that_fits(words: str, width: float, height: float) -> float:
    """Font size with which lines fit into a box of this size, all in points; a letter is 0.6 of its size wide."""
    lines = words.splitlines()
    return min(LARGEST_SIZE, 0.9 * width / (0.6 * max(map(len, lines))), 0.9 * height / (1.3 * len(lines)))


def _arrow(panel: Axes, way: np.ndarray) -> None:
    """A smooth line through the places of a way (P, 2), from below the first box to the top of the last."""
    ends = way.copy()
    ends[0, 1] += BOX[1] / 2
    ends[-1, 1] -= BOX[1] / 2 + 0.02
    parts = []
    for (x0, y0), (x1, y1) in pairwise(ends):
        t = np.linspace(0, 1, 24)
        parts.append(np.column_stack([x0 + (x1 - x0) * (3 * t**2 - 2 * t**3), y0 + (y1 - y0) * t]))
    curve = np.concatenate(parts)
    panel.plot(*curve[:-2].T, color=style.GREY, lw=0.9, zorder=1, solid_capstyle="round")
    panel.annotate(
        "",
        curve[-1],
        xytext=curve[-6],
        arrowprops={
            "arrowstyle": "-|>",
            "color": style.GREY,
            "lw": 0.9,
            "mutation_scale": 7,
            "shrinkA": 0,
            "shrinkB": 0,
        },
        zorder=2,
    )
