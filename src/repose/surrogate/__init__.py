"""Models of the responses, and where their samples are thin."""
