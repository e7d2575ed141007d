"""The usual way in the field: Plackett-Burman screening, steepest ascent, a response surface, its optimum, a check."""

from repose.strategies.response_surface.strategy import ResponseSurface

__all__ = ["ResponseSurface"]
