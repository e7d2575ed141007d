"""Files that are whole or not there."""

import json
import os
from pathlib import Path


def write_whole(path, write):
    """Write a file in one move: `write` gets the open file (bytes); an interrupt leaves the earlier file as it was.

    Folders that are missing are made.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        with open(part, "wb") as handle:
            write(handle)
            handle.flush()
            os.fsync(handle.fileno())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def write_json(path, content):
    """Write content as JSON in one move, see `write_whole`."""
    write_whole(path, lambda handle: handle.write((json.dumps(content, indent=1) + "\n").encode()))


def write_table(path, table):
    """Write a DataFrame as CSV without its index in one move, see `write_whole`."""
    write_whole(path, lambda handle: handle.write(table.to_csv(index=False).encode()))
