"""The documentation on the command line, and the messages that point to it."""

import ast
import re

from repose.cli import docs, main
from repose.core import places


def messages():
    """Every text of the program that is no docstring, with its file."""
    for path in places.PACKAGE.rglob("*.py"):
        tree = ast.parse(path.read_text())
        alone = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in alone:
                yield path.relative_to(places.PACKAGE), node.value


def test_the_pages_are_listed_and_printed(capsys):
    assert main(["docs"]) == 0
    listed = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert listed["photographs"] == "Photographs of piles"
    assert {"configuration", "library", "own_crop", "crops", "start"} <= set(listed)
    for name, title in listed.items():
        assert main(["docs", name]) == 0
        assert f"# {title}\n" in capsys.readouterr().out


def test_a_mistyped_page_is_guessed(capsys):
    assert main(["docs", "fotographs"]) == 2
    assert (
        "docs is 'fotographs'; expected a page that `repose docs` lists; did you mean photographs?"
        in capsys.readouterr().err
    )


def test_messages_name_pages_that_a_wheel_has():
    files = [*(places.PACKAGE / "config" / "new_crop").rglob("*.*")]
    files += [path for folder in ("config", "profiles") for path in (places.root() / folder).rglob("*.yaml")]
    texts = [*messages(), *((path.name, path.read_text()) for path in files)]
    named = {name for _, text in texts for name in re.findall(r"`repose docs (\w+)`", text)}
    assert {"photographs", "sequential", "own_simulator", "configuration"} <= named <= set(docs.pages())
    elsewhere = re.compile(r"(?<!research/)\b(docs|config|tests)/[\w/]+\.md\b")
    assert [path for path, text in texts if elsewhere.search(text)] == []
