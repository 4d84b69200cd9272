"""Opening files: of what kind they are, and what is known of them."""

import errno
import os

import numpy as np

from . import _isobrick
from ._arguments import (
    byte_count, check_names, integer, integers, number, numbers, path_text, slices_of,
    text_or_none, thread_count, unit_text,
)
from ._errors import UsageError
from ._progress import reporting
from ._samples import check_dtype
from ._volume import Volume


def _zarr_path(source):
    """The path of an array or a group of zarr."""
    kind = type(source.store).__name__
    folder = getattr(source.store, "path", None) or getattr(source.store, "root", None)
    if kind == "ZipStore" and not source.path:
        return str(folder)
    if folder is None or kind not in (
        "DirectoryStore", "NestedDirectoryStore", "FSStore", "LocalStore",
    ):
        raise UsageError(
            f"this array or group of zarr in a {kind} is not on the disk; isobrick.extract takes "
            "arrays of zarr"
        )
    return os.path.join(str(folder), source.path)


def is_url(path):
    """Whether it is a URL of a scheme that can be read."""
    return path.startswith(("http://", "https://", "s3://"))


def source_path(source):
    """The path of a file, or of a Zarr array or group on the disk, or a URL."""
    if hasattr(source, "store") and hasattr(source, "path") and hasattr(source, "attrs"):
        source = _zarr_path(source)
    path = path_text(source)
    if is_url(path):
        return path
    # The name of an array may follow that of its file: run.h5:/density.
    ends = [i for i in range(len(path)) if path.startswith(":/", i)] + [len(path)]
    if not any(os.path.exists(path[:end]) for end in ends):
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), path)
    return path


def _sample_type(dtype):
    native = check_dtype(dtype, "the file", wide=True)
    return "uint8" if native == np.dtype("?") else native.name


def volume_request(
    *, shape=None, dtype=None, big_endian=False, offset=None, spacing=None, origin=None, unit=None,
    channel=None, time=None, grid=None, stride=1, nodata=None, roi=None, memory=None, threads=0,
):
    """What is known of a file, for the C++ layer."""
    request = _isobrick.VolumeRequest()
    if shape is not None:
        request.extent = integers(shape, "shape")
    if dtype is not None:
        request.type = _sample_type(dtype)
        big_endian = big_endian or np.dtype(dtype).str.startswith(">")
    if big_endian:
        request.big_endian = True
    if offset is not None:
        request.offset = integer(offset, "offset", 0)
    if spacing is not None:
        request.spacing = numbers(spacing, 3, "spacing")
    if origin is not None:
        request.origin = numbers(origin, 3, "origin")
    request.unit = unit_text(unit) or None
    if channel is not None:
        request.channel = integer(channel, "channel", 0)
    if time is not None:
        request.time = integer(time, "time", 0)
    request.grid = text_or_none(grid, "grid")
    stride = stride if hasattr(stride, "__iter__") else (stride,) * 3
    request.stride = integers(stride, "stride")
    if nodata is not None:
        request.nodata = number(nodata, "nodata")
    if roi is not None:
        parts = slices_of(roi)
        lo, hi = [part.start for part in parts], [part.stop for part in parts]
        bounds = [[None if at is None else integer(at, "roi") for at in ends] for ends in (lo, hi)]
        request.set_roi(*bounds)
    if memory is not None:
        request.memory = byte_count(memory)
    request.threads = thread_count(threads)
    return request


def _reopened(path, arguments):
    """A volume from a pickle."""
    return open(path, **arguments)


def open(
    source, *, cache=True, cache_limit=20 * 2**30, remote_cache=None, memory=2**30, threads=0,
    progress=None, **request
):
    """Opens a volume of any format as a `Volume`.

    A store is opened in place. Anything else is converted first, into a cache that later calls
    find.

    Parameters
    ----------
    source : str, path, or a zarr array or group on the disk
        A store or a zip of one, or the URL of either (http, https, s3); a file of a known format,
        a folder of slices, FILE:/NAME for an array in a file.
    cache : bool or path
        Where stores of other formats are kept: True for ~/.cache/isobrick, or a folder. False:
        they go with the volume.
    cache_limit : int or str
        Bytes of all stores in the cache.
    remote_cache : int or str, optional
        Bytes of stores behind URLs that are kept in the folder of the cache, too. None: nothing.
    memory : int or str
        Budget of a conversion in bytes, or a text such as "512M".
    threads : int
        0: all cores.
    progress : function or tqdm, optional
        A function of (stage, done, total) in bytes, a tqdm bar, or the class `tqdm`.
    shape, dtype, offset, big_endian
        Of a raw file: samples along z, y, x, their type, bytes before the first, byte order.
    spacing, origin, unit
        Of world space x, y, z, in place of the file's.
    channel, time, grid
        Which of several volumes in the file.
    stride, roi, nodata
        Every so-many-th sample, an int or three along z, y, x; of those only the slices
        [z, y, x]; a value that means that a sample is missing.

    Raises FileNotFoundError, DamageError for broken files, UsageError where something must be
    chosen, Error otherwise.
    """
    check_names("open", request, set(volume_request.__kwdefaults__) - {"memory", "threads"})
    path = source_path(source)
    if cache is True:
        folder = _isobrick.default_cache_folder()
    else:
        folder = "" if cache in (False, None) else path_text(cache)
    native_request = volume_request(memory=memory, threads=threads, **request)
    with reporting(progress) as report:
        native = _isobrick.open(
            path, native_request, folder, byte_count(cache_limit, "cache_limit"),
            0 if remote_cache is None else byte_count(remote_cache, "remote_cache"),
            byte_count(memory), thread_count(threads), report,
        )
    arguments = dict(
        request, cache=cache, cache_limit=cache_limit, remote_cache=remote_cache, memory=memory,
        threads=threads,
    )
    place = path if is_url(path) else os.path.abspath(path)
    return Volume(native, (_reopened, (place, arguments)))
