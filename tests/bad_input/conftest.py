"""How a case of bad input is run, and what every answer to one has in common."""

import re

import pytest

from repose import cli

SENTENCE = r"repose: error: (.+: .+ is .+; expected .+|unknown .+: expected .+)"


def content(folder):
    return {
        path: path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


@pytest.fixture
def refused(tmp_path, monkeypatch, command):
    """Runs a verb that must end with status 2, a sentence for each fault, and nothing written; gives the sentences."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        before = content(tmp_path)
        stage = [cli.STAGE] if arguments[:1] and arguments[0] in cli.STAGES else []
        output = command(*stage, *arguments, status=2).err
        assert "Traceback" not in output
        lines = [line for line in output.splitlines() if "error: " in line]
        assert lines, output
        if not output.startswith(
            "usage: "
        ):  # argparse shows the usage before its sentence
            assert len(lines) == len(output.splitlines()), output
            for line in lines:
                assert re.match(SENTENCE, line, re.DOTALL), line
        assert content(tmp_path) == before, "something was written"
        return output

    return run
