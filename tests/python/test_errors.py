"""Exceptions, and messages that name arguments of Python."""

import pytest

import isobrick
from isobrick._errors import error_of, in_python, system_error


@pytest.mark.parametrize(
    "message, expected",
    [
        ("'a' exists already; add --force to replace it", "'a' exists already; add force=True to replace it"),
        ("at least --memory 12M is needed", "at least memory='12M' is needed"),
        ("--backend cuda: use --backend cpu", "backend='cuda': use backend='cpu'"),
        ("extract parts with --roi, or", "extract parts with roi, or"),
        ("add --spacing X,Y,Z", "add spacing"),
        ("states what --dims, --type, --endian and --offset are for",
         "states what shape, dtype, big_endian and offset are for"),
        ("try fewer --threads", "try fewer threads"),
        ("choose one with --grid NAME: a, b", "choose one with grid: a, b"),
        ("--device 7 does not exist", "device=7 does not exist"),
        ("run: isobrick index a --kind octree --force", "run: isobrick index a --kind octree --force"),
        ("'gdcmconv --raw' unpacks it", "'gdcmconv --raw' unpacks it"),
        ("a--b", "a--b"),
    ],
)
def test_messages_name_arguments(message, expected):
    assert in_python(message) == expected


def test_classes_of_errors():
    assert isinstance(error_of("DamageError", "x"), OSError)
    for code, base in ((2, FileNotFoundError), (13, PermissionError), (17, FileExistsError),
                       (20, NotADirectoryError), (28, OSError)):
        error = system_error(code, "cannot write")
        assert isinstance(error, base) and isinstance(error, isobrick.FileError)
        assert error.errno == code and str(error) == "cannot write"
        assert type(error) is type(system_error(code, "again"))
