"""The record of provenance in a result, by type of file.

A JSON file has it under the key ``provenance``, an .npz file as an array of this name, a PNG as a text of this name in
its header. Every other file has it in a sidecar, FILE.provenance.json.
"""

import errno
import json
import struct
import zipfile
import zlib
from collections.abc import Mapping
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import Any

KEY = "provenance"
PNG = b"\x89PNG\r\n\x1a\n"
SIDECAR = ".provenance.json"
HEADER = 33  # bytes of a PNG's signature and first chunk
# A flipped bit may turn on an archive's password or an unknown method, which is a RuntimeError.
UNREADABLE = (
    OSError,
    EOFError,
    ValueError,
    KeyError,
    RuntimeError,
    SyntaxError,
    zipfile.BadZipFile,
    zlib.error,
)


def plain_file(path: str | PathLike) -> Path:
    """Return the path of a file; OSError if a device or a pipe, which may never end, has it."""
    path = Path(path)
    if path.exists() and not path.is_file() and not path.is_dir():
        raise OSError(errno.EINVAL, "a device or a pipe", str(path))
    return path


def in_png(content: bytes, record: Mapping[str, Any]) -> bytes:
    """Put a record into the header of a PNG."""
    chunk = b"tEXt" + KEY.encode() + b"\0" + json.dumps(record).encode("ascii")
    framed = (
        struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk))
    )
    return content[:HEADER] + framed + content[HEADER:]


def read(path: str | PathLike) -> dict[str, Any] | None:
    """Read the record of a file; None if it has none or cannot be read."""
    path = Path(path)
    of_type = {".json": _from_json, ".npz": _from_npz, ".png": _from_png}.get(
        path.suffix, _from_sidecar
    )
    try:
        record = of_type(path)
    except UNREADABLE:
        return None
    return (
        record
        if isinstance(record, dict) and {"verb", "origin", "settings"} <= set(record)
        else None
    )


def _from_sidecar(path: Path) -> Any:
    return json.loads(Path(f"{path}{SIDECAR}").read_text(encoding="utf-8"))


def _from_json(path: Path) -> Any:
    content = json.loads(path.read_text(encoding="utf-8"))
    return content.get(KEY) if isinstance(content, dict) else None


def _from_npz(path: Path) -> Any:
    import numpy as np

    with np.load(path, allow_pickle=False) as store:
        return json.loads(str(store[KEY]))


def _from_png(path: Path) -> Any:
    from PIL import Image  # not by the processes that pour

    with (
        suppress(Image.DecompressionBombError),
        Image.open(path) as picture,
    ):  # larger than any of ours
        return json.loads(picture.info[KEY])
