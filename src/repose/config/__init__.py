"""The configuration: read, checked, and what a run of it costs."""
