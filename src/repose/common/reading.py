"""Read YAML strictly: refuse repeated keys and numbers in unusual forms."""

import copy
import functools
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import yaml

from repose.common.attached import require_plain_file
from repose.common.errors import InputError

# A valid line without indentation: a key with a colon, an empty line, or a line that
# begins with a special character of YAML, as comments, lists and quoted texts do.
KEY_AT_MARGIN = re.compile(r".+:(\s|$)|[\s#\[\]{}\"'%?!&*:|>-]|\.\.\.|$")
# A number in the usual form. YAML 1.1 also reads 010 as 8, 1:30 as 90, 1_0 as 10 and
# 0x10 as 16, which few users expect.
PLAIN_NUMBER = re.compile(
    r"[-+]?(0|[1-9]\d*)?(\.\d*)?([eE][-+]?\d+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)"
)
# Largest number of characters of all values, once aliases are replaced by the values
# that they stand for. The configuration paper.yaml has about 5,000 characters.
MAX_CHARACTERS = 200_000
# The tag of the key <<, which copies the keys of another mapping.
MERGE_TAG = "tag:yaml.org,2002:merge"
# Errors that PyYAML raises besides its own: for a date that does not exist, a tag
# without its value, or too many brackets.
OTHER_YAML_ERRORS = (
    ValueError,
    LookupError,
    AttributeError,
    TypeError,
    ArithmeticError,
    RecursionError,
)


class StrictLoader(yaml.SafeLoader):
    """A loader of YAML that refuses repeated keys and reads 2e-4 as a number.

    The rules of YAML 1.1 would read 2e-4 as text.
    """

    def construct_mapping(
        self, node: yaml.MappingNode, deep: bool = False
    ) -> dict[Any, Any]:
        """Make the mapping of a node; called by PyYAML.

        Parameters
        ----------
        node : yaml.MappingNode
            The parsed mapping, as pairs of nodes of its keys and values.
        deep : bool, optional
            Whether to make inner values immediately; PyYAML decides this.

        Returns
        -------
        dict
            The values by key.

        Raises
        ------
        InputError
            If a key is repeated, or is neither text nor number. The message names its
            line.
        """
        # Check the keys first: PyYAML's own method, which is called below, would keep
        # the last of several equal keys. It also replaces the keys `<<`.
        earlier_keys = set()
        for key_node, _ in node.value:
            # Skip the key `<<`. The mapping may repeat keys that are copied by it.
            if key_node.tag == MERGE_TAG:
                continue
            key = self._construct_key(key_node, deep)
            if key in earlier_keys:
                raise InputError(
                    self.describe_line(key_node),
                    key=str(key),
                    value="given again",
                    allowed="each key once",
                )
            earlier_keys.add(key)
        return super().construct_mapping(node, deep)

    def _construct_key(self, node: yaml.Node, deep: bool) -> str | int | float | None:
        """Make the key of a node.

        Raises
        ------
        InputError
            If the key is true, false, a date, a list or a mapping. The message names
            the line.
        """
        key = self.construct_object(node, deep=deep)
        # In Python, True and False are also integers.
        is_plain = isinstance(key, str | int | float | None)
        if not is_plain or isinstance(key, bool):
            is_scalar = isinstance(node.value, str)
            raise InputError(
                self.describe_line(node),
                key="key",
                value=node.value if is_scalar else "a list or mapping",
                allowed="text; put it in quotes if it is a name",
            )
        return key

    def describe_line(self, node: yaml.Node) -> str:
        """Describe where a node is, with its file and line."""
        return f"{self.name}, line {node.start_mark.line + 1}"

    def construct_number(self, node: yaml.ScalarNode) -> int | float:
        """Make the number of a node; called by PyYAML.

        Raises
        ------
        InputError
            If the number is written in an unusual form. The message names its line.
        """
        if not PLAIN_NUMBER.fullmatch(node.value):
            raise InputError(
                self.describe_line(node),
                key="value",
                value=node.value,
                allowed="a plain number, such as 90.5, or a text in quotes",
            )
        if node.tag.endswith(":int"):
            return self.construct_yaml_int(node)
        return self.construct_yaml_float(node)


for _kind in ("int", "float"):
    StrictLoader.add_constructor(
        f"tag:yaml.org,2002:{_kind}", StrictLoader.construct_number
    )
StrictLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$"),
    list("-+.0123456789"),
)


def read_yaml(path: str | os.PathLike) -> dict[str, Any]:
    """Read a YAML or JSON file that holds a mapping, without checking its keys.

    Parameters
    ----------
    path : path
        The file, in UTF-8.

    Returns
    -------
    dict
        The content as plain values.

    Raises
    ------
    InputError
        If the file is missing, has wrong syntax or repeats a key.
    """
    path = Path(path)
    try:
        text = require_plain_file(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(
            path,
            key="file",
            value=error.strerror,
            allowed="an existing YAML or JSON file that may be read",
        ) from None
    except UnicodeDecodeError:
        raise InputError(
            path, key="file", value="not text", allowed="a YAML or JSON file in UTF-8"
        ) from None
    content = parse_yaml(text, str(path))
    if not isinstance(content, dict):
        raise InputError(
            path,
            key="content",
            value="empty" if content is None else content,
            allowed="keys with values, as `repose new` writes them",
        )
    return content


def parse_yaml(text: str, name: str) -> Any:
    """Parse YAML or JSON, which is a part of YAML, into plain values.

    Parameters
    ----------
    text : str
        The YAML.
    name : str
        Its file, for messages.

    Raises
    ------
    InputError
        If the syntax is wrong. The message names the file and the line.
    """
    # Copy the cached value, because the caller may change it.
    return copy.deepcopy(_parse_cached(text, name))


# The default configuration takes 50 ms to parse, and every study reads it.
@functools.lru_cache(maxsize=16)
def _parse_cached(text: str, name: str) -> Any:
    """Parse YAML and cache the value, which the caller must not change.

    `parse_yaml` returns a copy of it. Every error of PyYAML is raised again as an
    InputError.
    """
    try:
        return _construct_document(text, name)
    except InputError:
        # Raise it unchanged. It is a ValueError, so the last clause would catch it.
        raise
    except yaml.MarkedYAMLError as error:
        raise _describe_syntax_error(error, text, name) from None
    except yaml.YAMLError as error:
        # Some errors have no line, for example that of an invalid byte.
        one_line = " ".join(str(error).split())
        raise InputError(
            name, key="content", value=one_line, allowed="valid YAML"
        ) from None
    except OTHER_YAML_ERRORS as error:
        raise InputError(
            name, key="content", value=str(error), allowed="valid YAML"
        ) from None


def _construct_document(text: str, name: str) -> Any:
    """Convert a YAML document to plain values.

    Parameters
    ----------
    text : str
        The document.
    name : str
        Name of its file, for messages.

    Returns
    -------
    object
        Plain values; None for an empty document.

    Raises
    ------
    InputError
        If the document is too large once its aliases are replaced.
    """
    loader = StrictLoader(text)
    try:
        loader.name = name
        node = loader.get_single_node()
        if node is None:
            return None
        # A few lines with nested aliases can stand for more than the memory can hold.
        # Count before the values are made. The counts of nodes are cached in the dict.
        n_characters = _count_characters(node, counts={})
        if n_characters > MAX_CHARACTERS:
            raise InputError(
                name,
                key="characters once every alias is replaced",
                value=n_characters,
                allowed=f"at most {MAX_CHARACTERS}",
            )
        return loader.construct_document(node)
    finally:
        loader.dispose()


def _describe_syntax_error(
    error: yaml.MarkedYAMLError, text: str, name: str
) -> InputError:
    """Describe a syntax error, with advice for common mistakes.

    Parameters
    ----------
    error : yaml.MarkedYAMLError
        The exception that PyYAML raised. It may lack a line.
    text : str
        The YAML.
    name : str
        Name of its file, for the message.

    Returns
    -------
    InputError
        The error to raise, which names the line if it is known.
    """
    line_number = error.problem_mark.line + 1 if error.problem_mark else 0
    problem = error.problem or ""

    # The parser reports a missing colon at a later line, so search all lines up to that
    # one.
    line_without_colon = _find_line_without_colon(text.splitlines()[:line_number])
    if line_without_colon is not None:
        number, line_text = line_without_colon
        return InputError(
            name,
            key=f"line {number}",
            value=line_text,
            allowed="KEY: VALUE, with a space after the colon",
        )

    # Recognise two common mistakes by the words of PyYAML: a backslash in double quotes
    # begins an "unknown escape character", and a tab is the "character '\t'".
    if "escape" in problem:
        allowed = r"a path in single quotes, as in 'C:\data\sizes.csv'"
    elif r"'\t'" in problem:
        allowed = "spaces in place of the tab"
    else:
        allowed = "valid YAML (indent by spaces, no tabs)"
    return InputError(
        name, key=f"line {line_number or '?'}", value=error.problem, allowed=allowed
    )


def _find_line_without_colon(lines: Sequence[str]) -> tuple[int, str] | None:
    """Find the first line without indentation that should be a key but has no colon.

    Parameters
    ----------
    lines : sequence of str
        The beginning of a document.

    Returns
    -------
    tuple of int and str, or None
        Number of the line, counted from 1, and its text. None if no line without a
        colon is known to be wrong.
    """
    for number, text in enumerate(lines, start=1):
        if KEY_AT_MARGIN.match(text):
            continue
        # The line may continue a text or list that spans several lines. It is then
        # valid, and the lines before it are an incomplete document.
        lines_before = "\n".join(lines[: number - 1])
        return (number, text) if _is_complete_document(lines_before) else None
    return None


def _is_complete_document(text: str) -> bool:
    """Tell whether a text is a complete and valid YAML document."""
    try:
        yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.YAMLError:
        return False
    return True


def _count_characters(node: yaml.Node, counts: dict[int, int]) -> int:
    """Count the characters of a node, with every alias replaced by its value.

    Each node counts as one more character, so that many empty values are large, too.

    Parameters
    ----------
    node : yaml.Node
        A value. An alias and the value that it stands for are the same node.
    counts : dict of int to int
        A cache of the counts of nodes, by their `id`. This function adds to it.

    Returns
    -------
    int
        The number of characters.
    """
    # An alias of this value was counted before.
    if id(node) in counts:
        return counts[id(node)]
    # A value may contain an alias of itself. Store 0 before its parts are counted, so
    # that the recursion ends there.
    counts[id(node)] = 0
    if isinstance(node, yaml.ScalarNode):
        n_characters = 1 + len(node.value)
    else:
        inner_counts = (
            _count_characters(part, counts) for part in _list_inner_nodes(node)
        )
        n_characters = 1 + sum(inner_counts)
    counts[id(node)] = n_characters
    return n_characters


def _list_inner_nodes(node: yaml.Node) -> Iterator[yaml.Node]:
    """Yield the entries of a list, or the keys and values of a mapping."""
    for item in node.value:
        if isinstance(item, tuple):
            yield from item
        else:
            yield item
