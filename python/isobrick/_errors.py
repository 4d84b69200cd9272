"""The exceptions of Isobrick. Each has one line: what is wrong, where, and what to do."""

import re


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


    def __reduce__(self):
        return system_error, (self.errno, str(self))


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


# Messages of the C++ layer name the options of the program.
_OPTIONS = {
    "bounds": "roi", "cache": "cache", "dims": "shape", "endian": "big_endian", "force": "force=True",
    "resume": "resume=True", "type": "dtype",
}
_OPTIONS |= {
    name: name
    for name in ("backend", "channel", "device", "grid", "memory", "offset", "origin", "roi",
                 "spacing", "threads", "time", "unit")
}
_OPTION = re.compile(r"--([a-z]+)\b(?: ([0-9]\S*?|[A-Z]+(?:,[A-Z]+)*|cpu|cuda)(?=[\s,;:.]|$))?")


def in_python(message):
    """A message with arguments in place of the program's options."""
    if "run: " in message or "isobrick index" in message:
        return message

    def argument(match):
        name, value = match.groups()
        if name not in _OPTIONS:
            return match.group()
        if value is None or "=" in _OPTIONS[name]:
            return _OPTIONS[name] + (f" {value}" if value else "")
        if value.isupper() and value.isalpha() or "," in value:
            return _OPTIONS[name]
        return f"{_OPTIONS[name]}={value if value.isdigit() else repr(value)}"

    return _OPTION.sub(argument, message)


def error_of(name, message):
    """The exception of a class of this module."""
    return globals()[name](in_python(message))
