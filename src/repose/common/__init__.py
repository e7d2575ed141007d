"""Code that all rooms share: errors, files, tables, sections, and records."""
