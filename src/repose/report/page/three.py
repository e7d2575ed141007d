"""three.js, the library of the 3-D view, as trimesh's own viewer holds it."""

import io
import re
from collections.abc import Iterable
from zipfile import BadZipFile, ZipFile

import trimesh
from trimesh import resources

from repose.common.errors import InputError, require

VIEWER, PAGE = "templates/viewer.zip", "viewer.html.template"  # of trimesh
# The library begins with its licence and ends as Rollup ends a module; TrackballControls and the viewer follow.
LIBRARY = re.compile(
    r'/\*\*\s*\* @license\s[^/]*Three\.js Authors.*?"__esModule",\{value:!0\}\)\}\)\);',
    re.DOTALL,
)
ALLOWED = "a version of trimesh whose viewer holds all that the 3-D view uses, as 4.8.3 to 5.2.0 do"


def library(names: Iterable[str]) -> str:
    """Read three.js from trimesh; InputError if trimesh has no three.js, or one without any of these classes."""
    try:
        with ZipFile(io.BytesIO(resources.get_bytes(VIEWER))) as viewer:
            found = LIBRARY.search(viewer.read(PAGE).decode())
    except (BadZipFile, KeyError, OSError, ValueError) as error:
        raise InputError(
            f"trimesh {trimesh.__version__}", VIEWER, str(error), ALLOWED
        ) from error
    if found is None:
        raise InputError(
            f"trimesh {trimesh.__version__}", VIEWER, "no three.js", ALLOWED
        )
    script = found.group()
    missing = [name for name in names if not re.search(rf"\.{name}\b", script)]
    require(
        not missing,
        f"trimesh {trimesh.__version__}",
        VIEWER,
        f"no {', '.join(missing)}",
        ALLOWED,
    )
    return script
