"""A build from a checkout names its commit in a file: so a wheel says where it comes from (`repose --version`)."""

import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

NAME = "commit.txt"
PLACES = {"wheel": f"repose/data/{NAME}", "sdist": NAME}


class CommitHook(BuildHookInterface):
    """Adds the file to a wheel, and to a source distribution, which hands it on to its wheel."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        path = Path(self.root) / NAME
        if (
            not path.is_file()
            and (Path(self.root) / ".git").exists()
            and shutil.which("git")
        ):
            words = ["git", "-C", self.root, "rev-parse", "--short=12", "HEAD"]
            self.made = tempfile.TemporaryDirectory()  # as long as the hook
            path = Path(self.made.name) / NAME
            path.write_text(
                subprocess.run(words, capture_output=True, text=True).stdout
            )
        if path.is_file() and version != "editable":
            build_data["force_include"][str(path)] = PLACES[self.target_name]
