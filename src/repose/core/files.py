"""Files that are whole or not there."""

import json

from repose.dem.io.whole import write_whole

__all__ = ["write_json", "write_table", "write_whole"]


def write_json(path, content):
    """Write content as JSON in one move, see `write_whole`."""
    write_whole(path, lambda handle: handle.write((json.dumps(content, indent=1) + "\n").encode()))


def write_table(path, table):
    """Write a DataFrame as CSV without its index in one move, see `write_whole`."""
    write_whole(path, lambda handle: handle.write(table.to_csv(index=False).encode()))
