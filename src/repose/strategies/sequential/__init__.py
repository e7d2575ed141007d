"""Few pours, each where it informs most: a space-filling start, then batches where the targets are probably met."""

from repose.strategies.sequential.strategy import Sequential

__all__ = ["Sequential"]
