"""The strategy `refined`: the published one that goes on near its answer until the simulated means meet the targets."""

from repose.strategies.refined.strategy import Refined

__all__ = ["Refined"]
