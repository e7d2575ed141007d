"""Read and write files, with one reader and one writer for each type.

A writer replaces a file atomically, so that no file is ever half written, and adds the
record of provenance of the current stage. It only replaces files that this program
wrote (`repose.common.ledger`). A reader reports everything that is wrong with a file as
an `InputError`, and leaves out the record of provenance.
"""

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from repose.common import attached, provenance, tables
from repose.common.errors import InputError
from repose.common.ledger import write_listed_file
from repose.common.tables import Column

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

StrPath = str | os.PathLike
# Type that the value of a key must have, or several allowed types.
Kind = type | tuple[type, ...]
# Column that only a record of runs has: the number of the proposal to which a run
# belongs.
TURN_COLUMN = "turn"
KIND_NAMES = {
    int: "an integer",
    float: "a number",
    str: "a text",
    list: "a list",
    dict: "a mapping",
}


def convert_to_path(name: str, path: Any) -> Path:
    """Convert an argument of a public function to a path, and check it.

    Parameters
    ----------
    name : str
        Name of the argument, for the message.
    path : object
        The value of the argument. The file need not exist.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    InputError
        If the value is neither a string nor a path, or the system refuses such a path.
    """
    # An empty string is no path. The public functions belong to a study, which is
    # therefore the source that the message names.
    is_path = isinstance(path, StrPath) and bool(str(path))
    if not is_path:
        raise InputError("study", key=name, value=path, allowed="the path of a file")
    # Ask the system whether it allows such a path. A missing or protected file is
    # reported later, when it is read or written.
    try:
        os.stat(path)
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        pass
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            "study", key=name, value=path, allowed=f"the path of a file; {reason}"
        ) from error
    return Path(path)


# --- writers --------------------------------------------------------------------------


def write_text(path: StrPath, text: str) -> None:
    """Write text as UTF-8."""
    write_bytes(path, text.encode())


def write_bytes(path: StrPath, content: bytes) -> None:
    """Write bytes, with the record of provenance of the current stage if there is one.

    The current stage is that of `repose.common.provenance.record_stage`. In a PNG, the
    record is part of the file itself. For any other file, it is written into a second
    file next to it, the sidecar. Outside a stage, a sidecar of an earlier file remains.

    Parameters
    ----------
    path : path
        The file.
    content : bytes
        Its content.

    Raises
    ------
    InputError
        If the path holds a file that this program did not write.
    """
    record = provenance.get_current_record()
    if record and content.startswith(attached.PNG_SIGNATURE):
        _write_listed_bytes(path, attached.add_to_png(content, record))
        return
    _write_listed_bytes(path, content)
    if record:
        text = json.dumps(record, indent=1) + "\n"
        _write_listed_bytes(f"{path}{attached.SIDECAR_SUFFIX}", text.encode())


def write_json(path: StrPath, content: Any, indent: int = 1) -> None:
    """Write content as JSON; numbers of numpy are written as plain numbers."""
    text = format_json(content, indent) + "\n"
    _write_listed_bytes(path, text.encode())


def format_json(content: Any, indent: int = 1) -> str:
    """Format content as JSON, and add the record of the current stage to a mapping.

    The current stage is that of `repose.common.provenance.record_stage`.

    Parameters
    ----------
    content : object
        Mappings, lists and plain values. Numbers and arrays of numpy become numbers and
        lists.
    indent : int, optional
        Number of spaces before each entry of the outermost mapping, at least 1.

    Returns
    -------
    str
        The JSON. If the content is a mapping and a stage is running, the record of the
        stage is its last entry, on one line.
    """
    text = json.dumps(content, indent=indent, default=_convert_to_plain)
    record = provenance.get_current_record()
    if not record or not isinstance(content, Mapping):
        return text

    # `json.dumps` would spread the record over many lines. Format it separately, and
    # insert it as one line before the closing brace, which is the last character.
    text_before_brace = text.removesuffix("}").rstrip()
    comma = "," if content else ""
    spaces = " " * indent
    entry = f"{spaces}{json.dumps(attached.RECORD_KEY)}: {json.dumps(record)}"
    return f"{text_before_brace}{comma}\n{entry}\n}}"


def write_table(
    path: StrPath,
    table: "pd.DataFrame",
    float_format: str | None = None,
    index: bool = False,
) -> None:
    """Write a table as CSV.

    Parameters
    ----------
    path : path
        The file.
    table : pandas.DataFrame
        The table.
    float_format : str, optional
        Format of the numbers, such as ``%.6g``. Without it all digits are written.
    index : bool
        Whether the index is the first column.

    Raises
    ------
    InputError
        If the file is a record of runs and the table is not, because the results in the
        record would be lost.
    """
    if TURN_COLUMN not in table and _is_record_of_runs(path):
        raise InputError(
            path,
            key="file",
            value="a record of runs",
            allowed="another name: the results in it would be lost",
        )
    write_text(path, table.to_csv(index=index, float_format=float_format))


def write_npz(path: StrPath, arrays: Mapping[str, Any]) -> None:
    """Write named arrays as a compressed .npz file, with the record of the stage."""
    import numpy as np

    record = provenance.get_current_record()
    content: dict[str, Any] = dict(arrays)
    if record:
        content[attached.RECORD_KEY] = np.array(json.dumps(record))
    write_listed_file(path, lambda handle: np.savez_compressed(handle, **content))


def write_image(path: StrPath, picture: "np.ndarray") -> None:
    """Write a picture in the format of the path's suffix.

    Parameters
    ----------
    path : path
        The file.
    picture : ndarray, (height, width) or (height, width, 3)
        Grey values, or colours in the order blue, green, red; uint8.

    Raises
    ------
    InputError
        If no format of pictures has this suffix.
    """
    import cv2

    suffix = Path(path).suffix
    try:
        is_encoded, content = cv2.imencode(suffix, picture)
    except cv2.error:
        # OpenCV does not know the suffix.
        is_encoded = False
    if not is_encoded:
        raise InputError(
            path,
            key="suffix",
            value=suffix,
            allowed="the suffix of a picture, as in .png",
        )
    write_bytes(path, content.tobytes())


def _write_listed_bytes(path: StrPath, content: bytes) -> None:
    """Write exactly these bytes, and list the file as one of this program."""
    write_listed_file(path, lambda handle: handle.write(content))


def _is_record_of_runs(path: StrPath) -> bool:
    """Tell from the header of a file whether it is a record of runs."""
    if not Path(path).is_file():
        return False
    with Path(path).open("rb") as file:
        return TURN_COLUMN.encode() in file.readline().strip().split(b",")


def _convert_to_plain(value: Any) -> Any:
    """Convert a number or array of numpy to plain Python values, for JSON."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")


# --- readers --------------------------------------------------------------------------


def read_table(
    path: StrPath, columns: Iterable[str | Column] = (), what: str = tables.TABLE
) -> "pd.DataFrame":
    """Read a CSV file that has at least these columns.

    In a column of measured numbers, each cell must be a finite number or empty.
    """
    return tables.read(path, columns, what, tables.holds_measurements).frame()


def read_json(
    path: StrPath,
    keys: Iterable[str] | Mapping[str, Kind] = (),
    what: str = "a JSON file",
) -> dict[str, Any]:
    """Read a JSON file that holds a mapping.

    Parameters
    ----------
    path : path
        The file.
    keys : iterable of str, or mapping of str to type
        Keys that the file must have. A mapping also gives the type of each value.
    what : str
        Description of the expected file, for messages.

    Returns
    -------
    dict
        The content of the file, without the record of provenance.

    Raises
    ------
    InputError
        If the file cannot be read, is not a mapping, lacks a key or has one twice, or
        has a value of another type.
    """
    try:
        # A device or a pipe is refused, because reading it might never end.
        text = attached.require_plain_file(path).read_bytes().decode("utf-8-sig")
        content = json.loads(text, object_pairs_hook=_make_unique_mapping)
    except OSError as error:
        raise InputError(
            path, key="file", value=error.strerror, allowed=what
        ) from error
    # A repeated key, invalid JSON and another encoding are all a ValueError, which is
    # among these errors. A deeply nested file is a RecursionError.
    except (*attached.READ_ERRORS, RecursionError) as error:
        raise InputError(path, key="content", value=str(error), allowed=what) from error
    if not isinstance(content, dict):
        raise InputError(path, key="content", value=content, allowed=what)
    content.pop(attached.RECORD_KEY, None)

    # A key without a given type may have a value of any type. The message begins like
    # "a number in" or "a key of", and ends with the description of the file.
    for key in keys:
        kind = keys[key] if isinstance(keys, Mapping) else object
        if key not in content or not isinstance(content[key], kind):
            raise InputError(
                path,
                key=key,
                value=content.get(key),
                allowed=f"{_describe_kind(kind)} {what}",
            )
    return content


def _make_unique_mapping(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Make the mapping of a JSON object; raise ValueError if it repeats a key."""
    content: dict[str, Any] = {}
    for key, value in pairs:
        if key in content:
            raise ValueError(f"the key {key} twice")
        content[key] = value
    return content


def _describe_kind(kind: Kind) -> str:
    """Describe a type for the beginning of a message, such as ``a number in``."""
    kinds = kind if isinstance(kind, tuple) else (kind,)
    names = [KIND_NAMES[one] for one in kinds if one in KIND_NAMES]
    return f"{' or '.join(names)} in" if names else "a key of"


def read_npz(
    path: StrPath, keys: Iterable[str] = (), what: str = "an .npz file"
) -> dict[str, "np.ndarray"]:
    """Read all arrays of an .npz file.

    Parameters
    ----------
    path : path
        The file.
    keys : iterable of str
        Names of arrays that the file must have.
    what : str
        What the file should be, for messages.

    Returns
    -------
    dict of str to ndarray
        The arrays by name, without the record of provenance.

    Raises
    ------
    InputError
        If the file cannot be read, or lacks an array.
    """
    import numpy as np

    # For a plain .npy file numpy returns an array. An array is not a context manager,
    # so `with` raises a TypeError.
    unreadable = (*attached.READ_ERRORS, TypeError, MemoryError)
    try:
        with np.load(attached.require_plain_file(path), allow_pickle=False) as store:
            # Check the names before unpacking: a small file may hold gigabytes of
            # zeros.
            for key in keys:
                if key not in store.files:
                    raise InputError(
                        path, key=key, value=None, allowed=f"an array in {what}"
                    )
            arrays = {
                name: store[name] for name in store.files if name != attached.RECORD_KEY
            }
    except InputError:
        # Raise it again, because the next clause would catch it as a ValueError.
        raise
    except unreadable as error:
        raise InputError(path, key="arrays", value=str(error), allowed=what) from error
    return arrays
