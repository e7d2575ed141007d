"""The display of `repose run` as a logger plugin: snakemake finds plugins by the names of their packages."""

from repose.cli.run_display import LogHandler

__all__ = ["LogHandler"]
