"""Read three.js, the library of the 3-D view, from the package that ships it."""

from importlib import resources

import jupyter_threejs_sage

# The package keeps the file of each release in a folder of its own.
SCRIPT_PATH = "static/r130/three.min.js"


def read_library() -> str:
    """Read three.js, which begins with its licence."""
    package = resources.files(jupyter_threejs_sage)
    return package.joinpath(SCRIPT_PATH).read_text(encoding="utf-8")
