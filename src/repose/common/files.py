"""Files: one writer and one reader for each type.

A writer writes in one move, so a file is whole or not there, and adds the record of provenance of the current stage. It
replaces only files that this program wrote (`repose.common.ledger`). A reader reports every fault of a file as an
`InputError`, and leaves the record out.
"""

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repose.common import attached, provenance, tables
from repose.common.errors import InputError, require
from repose.common.ledger import write_whole
from repose.common.tables import Column

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

Path_ = str | os.PathLike
UNREADABLE = attached.UNREADABLE
TURN = "turn"  # column of a record of runs alone: with which proposal a run was told
KINDS = {
    int: "an integer",
    float: "a number",
    str: "a text",
    list: "a list",
    dict: "a mapping",
}


def path_of(name: str, path: Any) -> Path:
    """Return an argument as a path; InputError for what is none."""
    require(
        isinstance(path, Path_) and str(path), "study", name, path, "the path of a file"
    )
    return Path(path)


def write_text(path: Path_, text: str) -> None:
    """Write a text as UTF-8, in one move."""
    write_bytes(path, text.encode())


def write_bytes(path: Path_, content: bytes) -> None:
    """Write bytes, in one move."""
    record = provenance.current()
    inside = content.startswith(attached.PNG)
    if record and inside:
        content = attached.in_png(content, record)
    write_whole(path, lambda handle: handle.write(content))
    if record and not inside:
        text = json.dumps(record, indent=1) + "\n"
        write_whole(
            f"{path}{attached.SIDECAR}", lambda handle: handle.write(text.encode())
        )


def write_json(path: Path_, content: Any, indent: int = 1) -> None:
    """Write content as JSON, in one move; numbers of numpy are written as plain numbers."""
    text = json_text(content, indent) + "\n"
    write_whole(path, lambda handle: handle.write(text.encode()))


def json_text(content: Any, indent: int = 1) -> str:
    """Return content as JSON; numbers of numpy become plain numbers."""
    record = provenance.current()
    if record and isinstance(content, Mapping):
        content = {**content, attached.KEY: record}
    return json.dumps(content, indent=indent, default=_plain)


def write_table(
    path: Path_,
    table: "pd.DataFrame",
    float_format: str | None = None,
    index: bool = False,
) -> None:
    """Write a table as CSV, in one move; `float_format` as in ``%.6g`` (None: all digits), `index` as first column."""
    if TURN not in table and Path(path).is_file():
        with Path(path).open("rb") as there:
            is_record = TURN.encode() in there.readline().strip().split(b",")
        require(
            not is_record,
            path,
            "file",
            "a record of runs",
            "another name: the results in it would be lost",
        )
    write_text(path, table.to_csv(index=index, float_format=float_format))


def write_npz(path: Path_, arrays: Mapping[str, Any]) -> None:
    """Write named arrays as a compressed .npz file, in one move."""
    import numpy as np

    record = provenance.current()
    content: dict[str, Any] = dict(arrays)
    if record:
        content[attached.KEY] = np.array(json.dumps(record))
    write_whole(path, lambda handle: np.savez_compressed(handle, **content))


def write_image(path: Path_, picture: "np.ndarray") -> None:
    """Write a picture (height, width) or (height, width, 3), uint8, blue first, in the format of the path's suffix."""
    import cv2

    suffix = Path(path).suffix
    try:
        done, content = cv2.imencode(suffix, picture)
    except cv2.error:
        done = False
    require(done, path, "suffix", suffix, "the suffix of a picture, as in .png")
    write_bytes(path, content.tobytes())


def read_table(
    path: Path_, columns: Iterable[str | Column] = (), what: str = tables.TABLE
) -> "pd.DataFrame":
    """Read a CSV file that has at least these columns; cells of columns of numbers are finite numbers or empty."""
    return tables.read(path, columns, what, tables.is_measured).frame()


def read_json(
    path: Path_,
    keys: Iterable[str] | Mapping[str, type | tuple[type, ...]] = (),
    what: str = "a JSON file",
) -> dict[str, Any]:
    """Read a JSON file that holds a mapping with at least these keys, of these types if `keys` is a mapping."""
    try:
        content = json.loads(attached.plain_file(path).read_bytes().decode("utf-8-sig"))
    except OSError as error:
        raise InputError(path, "file", error.strerror, what) from error
    except (*UNREADABLE, RecursionError) as error:
        raise InputError(path, "content", str(error), what) from error
    require(isinstance(content, dict), path, "content", content, what)
    content.pop(attached.KEY, None)
    for key in keys:
        kinds = keys[key] if isinstance(keys, Mapping) else object
        if key not in content or not isinstance(content[key], kinds):
            named = [
                KINDS.get(kind)
                for kind in (kinds if isinstance(kinds, tuple) else (kinds,))
            ]
            kind = (
                f"{' or '.join(filter(None, named))} in " if any(named) else "a key of "
            )
            raise InputError(path, key, content.get(key), f"{kind}{what}")
    return content


def read_npz(
    path: Path_, keys: Iterable[str] = (), what: str = "an .npz file"
) -> dict[str, "np.ndarray"]:
    """Read all arrays of an .npz file by name; `keys` must be among them."""
    import numpy as np

    try:
        with np.load(attached.plain_file(path), allow_pickle=False) as store:
            arrays = {name: store[name] for name in store.files if name != attached.KEY}
    except (
        *UNREADABLE,
        TypeError,
        MemoryError,
    ) as error:  # TypeError: a plain .npy array, which cannot be closed
        raise InputError(path, "arrays", str(error), what) from error
    for key in keys:
        require(key in arrays, path, key, None, f"an array in {what}")
    return arrays


def _plain(value: Any) -> Any:
    """Turn a number or array of numpy into Python's own."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")
