"""The kinds of wrong lines that `random_lines.py` draws from: small slips that a reader overlooks.

A comparison is one step off, as < for <=. `in` and `is` are inverted. A number is changed
by one if it is whole, else by a tenth. The first two arguments of a call are swapped. A
condition of `and` or `or`, of an `if` or of a comprehension is left out.
"""

import ast
from collections.abc import Iterator
from dataclasses import dataclass

# What stands for an operator, and what is wrong in its place.
WRONG_OPERATORS = {
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.In: ("in", "not in"),
    ast.NotIn: ("not in", "in"),
    ast.Is: ("is", "is not"),
    ast.IsNot: ("is not", "is"),
}


@dataclass(frozen=True)
class Place:
    """A part of a source, as offsets of bytes, with the texts that are wrong there."""

    start: int
    end: int
    wrong: tuple[str, ...]


class Source:
    """The source of a module, with the places where it can be made wrong."""

    def __init__(self, content: bytes) -> None:
        self.content = content
        self.tree = ast.parse(content)
        self.starts = [0]
        for line in content.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))

    def span(self, node: ast.expr) -> tuple[int, int]:
        """Begin and end of an expression."""
        begin = self.starts[node.lineno - 1] + node.col_offset
        return begin, self.starts[node.end_lineno - 1] + node.end_col_offset

    def text(self, node: ast.expr) -> str:
        begin, end = self.span(node)
        return self.content[begin:end].decode()

    def places(self) -> list[Place]:
        """All places, in the order of the source."""
        places = [
            Place(start, end, tuple(wrong))
            for node in self._read_nodes(self.tree)
            for start, end, *wrong in self._wrong(node)
        ]
        return sorted(places, key=lambda place: (place.start, place.end))

    def changed(self, place: Place, wrong: str) -> bytes | None:
        """The content with a wrong text; None if it is the same program, or none."""
        before = self.content[: place.start]
        after = self.content[place.end :]
        content = before + wrong.encode() + after
        try:
            tree = ast.parse(content)
        except SyntaxError:
            return None
        return None if ast.dump(tree) == ast.dump(self.tree) else content

    def _read_nodes(self, node: ast.AST) -> Iterator[ast.AST]:
        """The nodes that a run reads: without annotations and texts with values."""
        yield node
        for name, value in ast.iter_fields(node):
            if name in ("annotation", "returns") or isinstance(node, ast.JoinedStr):
                continue
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    yield from self._read_nodes(child)

    def _wrong(self, node: ast.AST) -> Iterator[tuple]:
        """Begin, end and the wrong texts of each place of one node."""
        if isinstance(node, ast.Compare):
            yield from self._comparisons(node)
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
            yield (*self.span(node), *numbers_near(node.value))
        elif isinstance(node, ast.Call):
            yield from self._swapped_arguments(node)
        elif isinstance(node, ast.BoolOp):
            for left_out in node.values:
                rest = [part for part in node.values if part is not left_out]
                kept = rest[0] if len(rest) == 1 else ast.BoolOp(node.op, rest)
                yield (*self.span(node), f"({ast.unparse(kept)})")
        elif isinstance(node, ast.If | ast.IfExp):
            if not is_type_checking(node.test):
                yield (*self.span(node.test), "True", "False")
        elif isinstance(node, ast.comprehension):
            for condition in node.ifs:
                yield (*self.span(condition), "True")

    def _comparisons(self, node: ast.Compare) -> Iterator[tuple]:
        left = node.left
        for right, operator in zip(node.comparators, node.ops, strict=True):
            begin = self.span(left)[1]
            end = self.span(right)[0]
            left = right
            if type(operator) in WRONG_OPERATORS:
                right_one, wrong = WRONG_OPERATORS[type(operator)]
                # Brackets around an operand stand between the two as well.
                between = self.content[begin:end].decode()
                yield begin, end, between.replace(right_one, wrong, 1)

    def _swapped_arguments(self, node: ast.Call) -> Iterator[tuple]:
        if len(node.args) < 2 or any(
            isinstance(part, ast.Starred) for part in node.args[:2]
        ):
            return
        first, second = node.args[:2]
        begin = self.span(first)[0]
        end = self.span(second)[1]
        between = self.content[self.span(first)[1] : self.span(second)[0]].decode()
        yield begin, end, f"{self.text(second)}{between}{self.text(first)}"


def numbers_near(number: float) -> tuple[str, ...]:
    """A whole number one off; another one off by a tenth."""
    if isinstance(number, int):
        return repr(number + 1), repr(number - 1)
    return repr(1.1 * number or 0.1), repr(0.9 * number or -0.1)


def is_type_checking(test: ast.expr) -> bool:
    return isinstance(test, ast.Name) and test.id == "TYPE_CHECKING"
