"""The one exception that a user's input can cause."""


class InputError(ValueError):
    """Bad input: the message names the file, the key or column, the value and what is allowed."""

    def __init__(self, source, key, value, allowed):
        self.source, self.key, self.value, self.allowed = source, key, value, allowed
        super().__init__(f"{source}: {key} is {value!r}; allowed: {allowed}")
