"""The other commands of the program as functions."""

import numpy as np

from . import _isobrick
from ._arguments import byte_count, check_names, integer, integers, number, path_text, thread_count
from ._errors import UsageError
from ._open import open, source_path, volume_request
from ._progress import reporting
from ._samples import ARRAY_NAMES, Samples
from ._volume import Volume

__all__ = ["convert", "export", "index", "info", "recode", "synth", "verify"]


def _convert_options(
    *, brick=None, shard=None, compression=3, levels=None, ome="0.5", downsampling=None,
    index=None, leaf=16, resume=False, force=False, memory=2**30, threads=0,
):
    options = _isobrick.ConvertOptions()
    options.brick = None if brick is None else integer(brick, "brick", -(2**31), 2**31 - 1)
    options.shard = None if shard is None else integer(shard, "shard", -(2**31), 2**31 - 1)
    if compression is None:
        options.set_uncompressed()
    elif isinstance(compression, str) and compression == "packed":
        options.set_packed()
    elif isinstance(compression, str) and compression == "auto":
        options.set_automatic()
    else:
        options.zstd_level = integer(compression, "compression", -(2**31), 2**31 - 1)
    options.levels = None if levels is None else integer(levels, "levels", -(2**31), 2**31 - 1)
    if str(ome) not in ("0.4", "0.5"):
        raise UsageError(f"ome must be '0.4' or '0.5', not {ome!r}")
    options.ome_04 = str(ome) == "0.4"
    if downsampling is not None and not options.set_downsampling(str(downsampling)):
        raise UsageError(
            f"downsampling must be mean, max, min, mode or stride, not {downsampling!r}"
        )
    if index is not None and not options.set_index(str(index)):
        raise UsageError(
            f"index must be linear, interval, kdtree, quadtree or octree, not {index!r}"
        )
    options.leaf = integer(leaf, "leaf", 1, 16)
    options.resume = bool(resume)
    options.force = bool(force)
    options.memory = byte_count(memory)
    options.threads = thread_count(threads)
    return options


_STORE_OPTIONS = (
    "brick", "shard", "compression", "levels", "ome", "downsampling", "index", "leaf", "resume",
    "force", "memory", "threads",
)


def _split(arguments):
    """The options of the store, and the others."""
    store = {name: arguments.pop(name) for name in _STORE_OPTIONS if name in arguments}
    return _convert_options(**store), arguments


def convert(source, path, *, progress=None, **options):
    """Converts a volume to a store at `path`, within a memory budget.

    Parameters
    ----------
    source : str, path, or array [z, y, x]
        A file or folder as of `isobrick.open`, or an array as of `Extractor`, read by blocks
        where it is not in memory.
    path : str or path
        The store, such as "ct.zarr". It has its name once it is whole.
    brick, shard : int
        Samples along each edge of a brick, and of a shard.
    compression : int, "packed", "auto" or None
        Level of zstd; "packed": bits of differences, decoded many times faster, but only by
        Isobrick; "auto": packed where it takes at most 1.1 times the bytes of zstd in some
        bricks; None: samples are stored as they are.
    levels : int
        Resolutions; by default until one brick holds the coarsest.
    downsampling : "mean", "max", "min", "mode" or "stride"
        How a level is made from the finer one. By default by the mean, of a label image by the mode.
    ome : "0.5" or "0.4"
        Version of OME-Zarr.
    index, leaf
        Also adds an index of this kind, as `isobrick.index` does.
    resume, force : bool
        Goes on with an interrupted conversion; replaces a store that exists.
    memory, threads, progress
        As of `isobrick.open`.
    shape, dtype, spacing, origin, unit, channel, time, …
        Of files, as of `isobrick.open`. Of arrays `spacing`, `origin`, `direction`, `unit`, `mask`
        and `nodata`, as of `Extractor`. Missing samples become NaN: the store of integers is then
        one of float32, or of float64 for 32 bits.

    Returns a dictionary of what was done: bytes_in, bytes_out, levels, bricks, seconds, codec, ….
    """
    store, others = _split(options)
    if hasattr(source, "dtype") and hasattr(source, "shape"):
        check_names("convert", others, ARRAY_NAMES)
        with reporting(progress) as report:
            return Samples(source, wide=True, **others).convert(path_text(path), store, report)
    check_names("convert", others, volume_request.__kwdefaults__)
    request = volume_request(memory=store.memory, threads=store.threads, **others)
    with reporting(progress) as report:
        return _isobrick.convert_file(source_path(source), path_text(path), request, store, report)


def recode(
    source, path, compression="auto", *, resume=False, force=False, memory=2**30, threads=0,
    progress=None,
):
    """Writes a store once more with another compression; all else stays as it is.

    Parameters
    ----------
    source : str or path
        The store: a folder, a zip of one, or the URL of either.
    path : str or path
        The new store, such as "fast.zarr" or "fast.zarr.zip". It has its name once it is whole.
    compression : int, "packed", "auto" or None
        As of `convert`.
    resume, force : bool
        Goes on with an interrupted run on the same store; replaces a store that exists.
    memory, threads, progress
        As of `isobrick.open`.

    Levels, ranges, histogram, indices and metadata are copied, and no sample is computed anew.
    Returns a dictionary as `convert` does.
    """
    options = _convert_options(
        compression=compression, resume=resume, force=force, memory=memory, threads=threads
    )
    with reporting(progress) as report:
        return _isobrick.recode(source_path(source), path_text(path), options, report)


def index(
    path, kind="octree", *, leaf=16, channel=None, time=None, resume=False, force=False,
    memory=2**30, threads=0, progress=None,
):
    """Adds a search structure to a store, and ranges to another program's OME-Zarr image.

    Parameters
    ----------
    path : str or path
        The store.
    kind : "linear", "interval", "kdtree", "quadtree", "octree" or "labels"
        The structure. "labels": lists of the labels in each brick of a label image, by which
        `Volume.extract_labels` of some labels reads the bricks that these lie in.
    leaf : int
        Cells along each edge of an item: 1, 2, 4, 8 or 16. Lists of labels have none.
    channel, time : int, optional
        Which volume of an image with several.
    resume, force, memory, threads, progress
        As of `convert`.

    Returns a dictionary: level_bytes, ranges_added, seconds.
    """
    request = volume_request(channel=channel, time=time, memory=memory, threads=threads)
    with reporting(progress) as report:
        return _isobrick.index(
            source_path(path), str(kind), integer(leaf, "leaf"), request, bool(resume),
            bool(force), report,
        )


def info(source, **request):
    """What is known of a volume without reading its samples, as a dictionary.

    shape [z, y, x], dtype, spacing, origin and direction (x, y, z), unit, levels, codec,
    fill_value, grid_class, grid_name, is_store. Arguments are those of `isobrick.open` that
    describe a file.
    """
    if isinstance(source, Volume):
        return source.info
    check_names("info", request, volume_request.__kwdefaults__)
    return _isobrick.describe(source_path(source), volume_request(**request))


def verify(path, *, channel=None, time=None, memory=2**30, threads=0, progress=None):
    """Reads all of a store and checks every checksum, range and size.

    Returns a dictionary: whole (bool), bricks, bytes_read, damage_count, damages (a line each).
    """
    request = volume_request(channel=channel, time=time, memory=memory, threads=threads)
    with reporting(progress) as report:
        return _isobrick.verify(source_path(path), request, report)


def export(source, path, *, progress=None, **options):
    """Writes the samples of a volume as a file: `Volume.export` of what `isobrick.open` opens."""
    volume = source if isinstance(source, Volume) else open(source, progress=progress)
    volume.export(path, progress=progress, **options)


def synth(
    kind, path=None, *, shape, dtype="uint8", seed=1, frequency=None, noise=0.01, progress=None,
    **options,
):
    """A procedural volume, the same on every machine.

    Parameters
    ----------
    kind : "sphere", "gyroid", "marschner-lobb", "mixing" or "cells"
        The field.
    path : str or path, optional
        A store to write. None: returns an array [z, y, x].
    shape : three ints
        Samples along z, y, x.
    dtype : dtype
        uint8 … float64; of "cells" also uint64 and int64.
    seed, frequency, noise
        Of random numbers; periods along the longest edge; amplitude of a gyroid's noise.
    progress, and those of `convert` that concern the store
        Where a store is written.
    """
    shape = integers(shape, "shape")
    if min(shape) < 1:
        raise UsageError(f"shape must be positive, not {shape}")
    arguments = (
        str(kind), shape, np.dtype(dtype).name, integer(seed, "seed", 0, 2**64 - 1),
        None if frequency is None else number(frequency, "frequency"), number(noise, "noise"),
    )
    if path is None:
        if options:
            raise TypeError(f"{sorted(options)} concern a store; give its path")
        return _isobrick.synth_array(*arguments)
    store, others = _split(options)
    check_names("synth", others, ())
    with reporting(progress) as report:
        return _isobrick.synth_store(path_text(path), *arguments, store, report)
