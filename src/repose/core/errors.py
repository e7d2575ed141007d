"""The exceptions: what a user's input can cause, and a pile without an angle."""

from repose.dem.errors import InputError

__all__ = ["InputError", "NoFlankError"]


class NoFlankError(ValueError):
    """The picture or the pile has no flank to measure; `reason` says why.

    Parameters
    ----------
    reason : str
        Why there is no flank.
    """

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(reason)
