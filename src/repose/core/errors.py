"""The exceptions: what a user's input can cause, and a pile without an angle."""


class InputError(ValueError):
    """Bad input: the message names the file, the key or column, the value and what is allowed."""

    def __init__(self, source, key, value, allowed):
        self.source, self.key, self.value, self.allowed = source, key, value, allowed
        super().__init__(f"{source}: {key} is {value!r}; allowed: {allowed}")


class NoFlankError(ValueError):
    """The picture or the pile has no flank to measure; `reason` says why."""

    def __init__(self, reason):
        self.reason = reason
        super().__init__(reason)
