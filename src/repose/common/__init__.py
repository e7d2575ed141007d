"""Code that all rooms share: errors, files, tables, sections of settings, and records."""
