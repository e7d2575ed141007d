"""The exception that a file given by the user can cause."""


class InputError(ValueError):
    """A file, or an entry of it, that cannot be used.

    Parameters
    ----------
    source : str or path
        The file.
    key : str
        What is wrong in it.
    value : object
        What was found.
    allowed : str
        What is allowed there.
    """

    def __init__(self, source: object, key: str, value: object, allowed: str) -> None:
        self.source, self.key, self.value, self.allowed = source, key, value, allowed
        super().__init__(f"{source}: {key} is {value!r}; allowed: {allowed}")
