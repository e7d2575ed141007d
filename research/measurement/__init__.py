"""The definitions of the angle of repose compared."""
