"""Write and read the record of provenance in a result, by type of file.

A JSON file has the record under the key ``provenance``, an .npz file as an array of
this name, and a PNG as a text entry of this name. The record of any other file is in a
second file next to it, the sidecar FILE.provenance.json.
"""

import errno
import io
import json
import zipfile
import zlib
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

RECORD_KEY = "provenance"
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"  # the first bytes of a PNG
SIDECAR_SUFFIX = ".provenance.json"
REQUIRED_ENTRIES = {"verb", "origin", "settings"}
# Errors that the libraries raise for a missing or damaged file. A damaged archive may
# seem to have a password or an unknown compression, for which zipfile raises a
# RuntimeError.
READ_ERRORS = (
    OSError,
    EOFError,
    ValueError,
    KeyError,
    RuntimeError,
    SyntaxError,
    zipfile.BadZipFile,
    zlib.error,
)


def require_plain_file(path: str | PathLike) -> Path:
    """Return the path of a file, and refuse a device or a pipe.

    Reading a device or a pipe might never end. A missing file is not refused here.

    Raises
    ------
    OSError
        If the path is neither a file nor a folder, but exists.
    """
    path = Path(path)
    if path.exists() and not path.is_file() and not path.is_dir():
        raise OSError(errno.EINVAL, "a device or a pipe", str(path))
    return path


def add_to_png(content: bytes, record: Mapping[str, Any]) -> bytes:
    """Add a record of provenance to the text entries of a PNG.

    Parameters
    ----------
    content : bytes
        The PNG, which has no such record yet.
    record : mapping
        The record; it is stored as JSON under the key `RECORD_KEY`.

    Returns
    -------
    bytes
        The same picture, with its other text entries and its resolution unchanged.
    """
    from PIL import Image
    from PIL.PngImagePlugin import PngImageFile, PngInfo

    texts = PngInfo()
    output = io.BytesIO()
    with Image.open(io.BytesIO(content)) as picture:
        assert isinstance(picture, PngImageFile)
        # Pillow drops the text entries of the original unless they are passed again.
        for key, text in picture.text.items():
            texts.add_text(key, text)
        texts.add_text(RECORD_KEY, json.dumps(record))
        picture.save(output, "PNG", pnginfo=texts, dpi=picture.info.get("dpi"))
    return output.getvalue()


def read_record(path: str | PathLike) -> dict[str, Any] | None:
    """Read the record of provenance of a file.

    Parameters
    ----------
    path : path
        A file of any type. Its suffix determines where its record is.

    Returns
    -------
    dict or None
        The record; None if the file has no valid record or cannot be read.
    """
    path = Path(path)
    readers = {".json": _read_json, ".npz": _read_npz, ".png": _read_png}
    reader = readers.get(path.suffix, _read_sidecar)
    try:
        record = reader(path)
    except READ_ERRORS:
        return None
    # A file of another program may use the same key for something else.
    is_valid = isinstance(record, dict) and record.keys() >= REQUIRED_ENTRIES
    return record if is_valid else None


def _read_sidecar(path: Path) -> Any:
    """Read the record in the sidecar of a file."""
    return json.loads(Path(f"{path}{SIDECAR_SUFFIX}").read_text(encoding="utf-8"))


def _read_json(path: Path) -> Any:
    """Read the record in a JSON file; None if the file does not contain a mapping."""
    content = json.loads(path.read_text(encoding="utf-8"))
    return content.get(RECORD_KEY) if isinstance(content, dict) else None


def _read_npz(path: Path) -> Any:
    """Read the record in an .npz file."""
    import numpy as np

    with np.load(path, allow_pickle=False) as store:
        return json.loads(str(store[RECORD_KEY]))


def _read_png(path: Path) -> Any:
    """Read the record in a PNG; None if the picture is too large to be one of ours."""
    # Import Pillow only here, because processes that simulate read no picture.
    from PIL import Image

    try:
        with Image.open(path) as picture:
            return json.loads(picture.info[RECORD_KEY])
    except Image.DecompressionBombError:
        return None
