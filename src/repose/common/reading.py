"""Strict reading of YAML: no key twice, numbers as numbers."""

import copy
import functools
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from repose.common.attached import plain_file
from repose.common.errors import InputError, require

KEY_AT_MARGIN = re.compile(r".+:(\s|$)|[\s#\[\]{}\"'%?!&*:|>-]|\.\.\.|$")
# YAML 1.1 also takes 010 for 8, 1:30 for 90, 1_0 for 10 and 0x10 for 16.
PLAIN_NUMBER = re.compile(
    r"[-+]?(0|[1-9]\d*)?(\.\d*)?([eE][-+]?\d+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)"
)
MOST_CHARACTERS = (
    200_000  # of all values with their aliases replaced; paper.yaml has some 5,000
)


class StrictLoader(yaml.SafeLoader):
    """YAML that refuses a key given twice and reads 2e-4 as a number (YAML 1.1 takes it for text)."""

    def construct_mapping(
        self, node: yaml.MappingNode, deep: bool = False
    ) -> dict[Any, Any]:
        """Make the mapping of a node; called by PyYAML. InputError names the line of a key that stands twice."""
        seen = set()
        for key_node, _ in node.value:
            if (
                key_node.tag == "tag:yaml.org,2002:merge"
            ):  # <<, whose keys the others replace
                continue
            key = self.construct_object(key_node, deep=deep)
            found = (
                key_node.value
                if isinstance(key_node.value, str)
                else "a list or mapping"
            )
            good = isinstance(key, str | int | float | None) and not isinstance(
                key, bool
            )
            require(
                good,
                self.place_of(key_node),
                "key",
                found,
                "text; put it in quotes if it is a name",
            )
            require(
                key not in seen,
                self.place_of(key_node),
                str(key),
                "given again",
                "each key once",
            )
            seen.add(key)
        return super().construct_mapping(node, deep)

    def place_of(self, node: yaml.Node) -> str:
        """Name file and line of a node."""
        return f"{self.name}, line {node.start_mark.line + 1}"

    def construct_number(self, node: yaml.ScalarNode) -> int | float:
        """Make the number of a node; called by PyYAML. InputError names the line of one that is no plain number."""
        allowed = "a plain number, such as 90.5, or a text in quotes"
        require(
            PLAIN_NUMBER.fullmatch(node.value),
            self.place_of(node),
            "value",
            node.value,
            allowed,
        )
        return (
            self.construct_yaml_int
            if node.tag.endswith(":int")
            else self.construct_yaml_float
        )(node)


for _kind in ("int", "float"):
    StrictLoader.add_constructor(
        f"tag:yaml.org,2002:{_kind}", StrictLoader.construct_number
    )
StrictLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$"),
    list("-+.0123456789"),
)


def read(path: str | os.PathLike) -> dict[str, Any]:
    """Read the mapping in a YAML or JSON file, unchecked; InputError for a missing file, bad syntax or a key twice."""
    path = Path(path)
    try:
        text = plain_file(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(
            path,
            "file",
            error.strerror,
            "an existing YAML or JSON file that may be read",
        ) from None
    except UnicodeDecodeError:
        raise InputError(
            path, "file", "not text", "a YAML or JSON file in UTF-8"
        ) from None
    content = parse(text, str(path))
    found, allowed = (
        "empty" if content is None else content,
        "keys with values, as `repose new` writes them",
    )
    require(isinstance(content, dict), path, "content", found, allowed)
    return content


def parse(text: str, name: str) -> Any:
    """Read YAML, and so JSON, as plain values; InputError with the file's `name` and the line for bad syntax."""
    # The caller may change what it gets.
    return copy.deepcopy(_parse(text, name))


# The defaults of all studies take 50 ms to parse, and every load reads them anew.
@functools.lru_cache(maxsize=16)
def _parse(text: str, name: str) -> Any:
    """Read YAML as `parse` does; the result is not to be changed."""
    loader = None
    try:
        loader = StrictLoader(text)
        loader.name = name
        node = loader.get_single_node()
        if node is None:
            return None
        characters = _characters(node, {})
        few, allowed = characters <= MOST_CHARACTERS, f"at most {MOST_CHARACTERS}"
        require(
            few, name, "characters once every alias is replaced", characters, allowed
        )
        return loader.construct_document(node)
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 0
        fault = line or "?", error.problem, "valid YAML (indent by spaces, no tabs)"
        if "escape" in (error.problem or ""):
            fault = *fault[:2], r"a path in single quotes, as in 'C:\data\sizes.csv'"
        elif r"'\t'" in (error.problem or ""):
            fault = *fault[:2], "blanks in place of the tab"
        if found := _without_colon(text.splitlines()[:line]):
            fault = *found, "KEY: VALUE, with a space after the colon"
        raise InputError(name, f"line {fault[0]}", *fault[1:]) from None
    except yaml.YAMLError as error:  # such as an invalid byte
        raise InputError(
            name, "content", " ".join(str(error).split()), "valid YAML"
        ) from None
    except InputError:
        raise
    # other errors of PyYAML: a day that does not exist, a tag without its value, too many brackets
    except (
        ValueError,
        LookupError,
        AttributeError,
        TypeError,
        ArithmeticError,
        RecursionError,
    ) as error:
        raise InputError(name, "content", str(error), "valid YAML") from None
    finally:
        if loader is not None:
            loader.dispose()


def _without_colon(lines: Sequence[str]) -> tuple[int, str] | None:
    """Find the first line at the margin that is no key with its value: number and words; None without any."""
    number, words = next(
        (
            (k, words)
            for k, words in enumerate(lines, start=1)
            if not KEY_AT_MARGIN.match(words)
        ),
        (0, ""),
    )
    try:  # within a text or list over several lines it is good
        yaml.compose("\n".join(lines[: max(number - 1, 0)]), Loader=yaml.SafeLoader)
    except yaml.YAMLError:
        return None
    return (number, words) if number else None


def _characters(node: yaml.Node, known: dict[int, int]) -> int:
    """Count the characters of a node with its aliases replaced; a recursive alias counts 0."""
    if id(node) not in known:
        known[id(node)] = 0
        if isinstance(node, yaml.ScalarNode):
            known[id(node)] = 1 + len(node.value)
        else:
            inside = (
                part
                for item in node.value
                for part in (item if isinstance(item, tuple) else (item,))
            )
            known[id(node)] = 1 + sum(_characters(part, known) for part in inside)
    return known[id(node)]
