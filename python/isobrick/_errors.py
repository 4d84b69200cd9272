"""The exceptions of Isobrick. Each has one line: what is wrong, where, and what to do."""


class Error(RuntimeError):
    """Anything that stops an operation."""


class UsageError(Error, ValueError):
    """The request makes no sense: a wrong option, shape or budget."""


class DamageError(Error, OSError):
    """Stored bytes are not what they must be."""


class FileError(Error, OSError):
    """The system refuses a file or a folder: `errno` tells why.

    It is also a FileNotFoundError, a PermissionError or another class that Python has for `errno`.
    """


_classes = {}


def system_error(code, message):
    """The exception for a value of errno."""
    base = type(OSError(code, message))
    if base not in _classes:
        bases = (FileError,) if base is OSError else (FileError, base)
        _classes[base] = type("FileError", bases, {"__module__": "isobrick"})
    error = _classes[base](message)
    error.errno = code
    return error
