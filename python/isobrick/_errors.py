"""The exceptions of Isobrick. Each has one line: what is wrong, where, and what to do."""


class Error(RuntimeError):
    """Anything that stops an operation."""


class UsageError(Error, ValueError):
    """The request makes no sense: a wrong option, shape or budget."""


class DamageError(Error, OSError):
    """Stored bytes are not what they must be."""
