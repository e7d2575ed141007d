"""The bench tests, built from the engine: build, run, measure."""
