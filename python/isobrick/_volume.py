"""Volumes in files: stores, and whatever else the program opens."""

import errno
import os
from dataclasses import dataclass

import numpy as np

from . import _isobrick
from ._arguments import (
    box_of, byte_count, check_names, extract_options, filter_options, histogram_bins, integer, integers, is_list,
    mesh_file_options, number, numbers, one_isovalue, path_text, slices_of, text_or_none,
    thread_count, unit_text,
)
from ._errors import UsageError
from ._indexing import read_indexed
from ._mesh import Mesh, with_measure
from ._progress import reporting
from ._samples import check_dtype


@dataclass(frozen=True)
class Level:
    """One resolution of a volume; level 0 is the finest.

    `shape`, `brick` and `shard` are samples along z, y, x. `spacing`, `origin` and the rotation
    `direction` (nine numbers, row by row) are in world space x, y, z, in `unit`.
    """

    shape: tuple
    spacing: tuple
    origin: tuple
    direction: tuple
    unit: str
    brick: tuple
    shard: tuple


@dataclass(frozen=True)
class Histogram:
    """How the samples of a level spread over their values.

    Bin i counts the samples from `first + i * bin_width` to below `first + (i + 1) * bin_width`.
    `lo` and `hi` are the smallest and the largest finite sample.
    """

    counts: np.ndarray
    first: float
    bin_width: float
    lo: float
    hi: float
    level: int
    nan: int
    infinite: int

    @property
    def edges(self):
        """The bounds of the bins, one more than there are bins, as `numpy.histogram` has them."""
        return self.first + self.bin_width * np.arange(len(self.counts) + 1)


class Volume:
    """A volume that `isobrick.open` has opened. Reads from the disk what is needed, when it is.

    Arrays and all that indexes them are in the order z, y, x; world space is x, y, z. A pickle of it
    has the path and is opened again.
    """

    def __init__(self, native):
        self._native = native
        self._opened = None
        self._info = native.info
        self._levels = tuple(
            Level(**{**level, "direction": tuple(level["direction"])})
            for level in self._info["levels"]
        )

    def __reduce__(self):
        return _reopened, self._opened

    @property
    def path(self):
        """The store's folder; of a volume that is no store, that of its store in the cache."""
        return self._info["path"]

    @property
    def levels(self):
        """The resolutions, the finest first: a tuple of `Level`."""
        return self._levels

    @property
    def shape(self):
        """Samples of level 0 along z, y, x."""
        return self._info["shape"]

    @property
    def ndim(self):
        """Three."""
        return 3

    @property
    def dtype(self):
        """The NumPy dtype of the samples."""
        return np.dtype(self._info["dtype"])

    @property
    def spacing(self):
        """World distance between samples of level 0 along x, y, z, in `unit`."""
        return self._info["spacing"]

    @property
    def origin(self):
        """The place of sample [0, 0, 0] in world space x, y, z."""
        return self._info["origin"]

    @property
    def direction(self):
        """A 3×3 rotation; its columns are the world directions of the index axes x, y, z."""
        return np.array(self._info["direction"]).reshape(3, 3)

    @property
    def unit(self):
        """The unit of world space, such as "millimeter", or ""."""
        return self._info["unit"]

    @property
    def range(self):
        """(smallest, largest) sample of level 0, or None where it is not known."""
        return self._native.range

    @property
    def info(self):
        """All that is known, as a dictionary; see `isobrick.info`."""
        return self._info

    @property
    def notes(self):
        """Remarks of the reader, a sentence each."""
        return self._native.notes

    def __repr__(self):
        size = "×".join(map(str, self.shape))
        return (
            f"<isobrick.Volume {self.path!r}: {size} [z, y, x] of {self.dtype}, "
            f"{len(self.levels)} level{'s' if len(self.levels) != 1 else ''}>"
        )

    def isovalue(self, text, *, progress=None):
        """The isovalue that a text means.

        "300", "otsu" (Otsu's threshold), "p99.5" (a percentile), "50%" (of the range), "300HU" or
        a preset such as "ct-bone". Reads the histogram where that is needed.
        """
        return one_isovalue(text, self.isovalues(text, progress=progress))

    def isovalues(self, text, *, progress=None):
        """The isovalues of a list or steps such as "100:500:50" or "otsu,p90"."""
        if not isinstance(text, str):
            return [number(text, "isovalue")]
        with reporting(progress) as report:
            return self._native.isovalues(text, report)

    def suggested_isovalue(self, *, progress=None):
        """(isovalue, why it is suggested), or None where no surface exists."""
        with reporting(progress) as report:
            return self._native.suggested_isovalue(report)

    def histogram(self, bins=64, *, progress=None):
        """The `Histogram` in at most so many bins: the stored one, else of a level that is small."""
        with reporting(progress) as report:
            return Histogram(**self._native.histogram(histogram_bins(bins), report))

    def extract(
        self, isovalue, *, level=0, roi=None, normals=False, inside=None, drop_degenerate=False,
        topology="consistent", min_component=0, largest=0, smooth=0, pass_band=0.1, backend="auto",
        memory=2**30, threads=0, gpu_memory=0, device=0, progress=None,
    ):
        """The surface of an isovalue as a `Mesh`.

        Parameters
        ----------
        isovalue : float, str, or a list of them
            A number, or a text as of `isovalue()`, such as "otsu". A list gives a list of meshes,
            made in one pass over the volume where `memory` has room.
        level : int
            0: the finest.
        roi : slices [z, y, x], optional
            Only these samples of the level, such as `numpy.s_[0:10, :, 5:]`.
        normals : bool
            Adds normals, from the gradient of the samples.
        inside : "above", "below" or None
            Which samples are inside. None: below in a level set, else above.
        drop_degenerate : bool
            Leaves triangles without area out.
        topology : "consistent" or "trilinear"
            How the surface passes where the corners of a cell allow several ways: by a rule for
            faces, or as the trilinear interpolant does; on the CPU.
        min_component : int
            Drops components with fewer triangles.
        largest : int
            Keeps so many components, those with most triangles; 0: all.
        smooth : int
            Iterations of smoothing that keeps the size (Taubin); open borders stay where they are.
        pass_band : float
            Of the smoothing: what varies more along the surface goes, from 0, all, to 0.8, little.
        backend : "auto", "cpu" or "cuda"
            What makes the surface; the mesh is the same.
        memory, gpu_memory : int or str
            Budgets in bytes, or texts such as "512M", for all but the mesh.
        threads : int
            0: all cores.
        progress : function or tqdm, optional
            A function of (stage, done, total) in bytes, a tqdm bar, or the class `tqdm`.
        """
        request = dict(
            level=level, roi=roi, normals=normals, inside=inside,
            drop_degenerate=drop_degenerate, topology=topology, backend=backend, memory=memory,
            threads=threads, gpu_memory=gpu_memory, device=device, progress=progress,
        )
        filters = filter_options(
            min_component=min_component, largest=largest, smooth=smooth, pass_band=pass_band,
        )
        if is_list(isovalue):
            return self._extract_several(isovalue, request, filters)
        options = self._surface(isovalue, **request)
        with reporting(progress) as report:
            return Mesh._of(self._native.extract(options, filters, report))

    def _extract_several(self, isovalues, request, filters):
        isovalues = [self.isovalue(one, progress=request["progress"]) for one in isovalues]
        if not isovalues:
            return []
        options = self._surface(isovalues[0], **request)
        with reporting(request["progress"]) as report:
            meshes = self._native.extract_several(options, filters, isovalues, report)
        return [Mesh._of(mesh) for mesh in meshes]

    def save_mesh(
        self, path, isovalue, *, level=0, roi=None, normals=False, inside=None,
        drop_degenerate=False, topology="consistent", min_component=0, largest=0, smooth=0,
        pass_band=0.1, measure=False, backend="auto", memory=2**30, threads=0, gpu_memory=0, device=0,
        progress=None, force=False, quantize=False,
    ):
        """Streams a surface to a mesh file, so that volume and mesh may be larger than memory.

        The arguments are those of `extract` and of `Mesh.save`. Returns a dictionary of what was
        done: vertices, faces, bricks, bricks_read, bytes_read, backend, seconds, and with
        `measure` a `Measure` of the mesh.
        """
        filters = filter_options(
            min_component=min_component, largest=largest, smooth=smooth, pass_band=pass_band,
            measure=measure,
        )
        options = self._surface(
            isovalue, progress=progress, level=level, roi=roi, normals=normals, inside=inside,
            drop_degenerate=drop_degenerate, topology=topology, backend=backend, memory=memory,
            threads=threads, gpu_memory=gpu_memory, device=device,
        )
        file = mesh_file_options(force=force, quantize=quantize, threads=threads, memory=memory)
        with reporting(progress) as report:
            return with_measure(
                self._native.save_mesh(options, filters, path_text(path), file, report)
            )

    def estimate(self, isovalue, *, level=0, roi=None):
        """About how large a mesh will be: vertices, faces and their relative uncertainty."""
        options = self._surface(isovalue, level=level, roi=roi)
        return self._native.estimate(options)

    def read(self, level=0, roi=None, *, threads=0):
        """Samples of a level as a new array [z, y, x].

        `roi` are slices such as `numpy.s_[0:10, :, 5:]`; None: all of the level.
        """
        shape = self._level(level).shape
        box = box_of(roi, shape) or ((0, 0, 0), shape)
        return self._native.read(level, box, thread_count(threads))

    def __getitem__(self, index):
        """Samples of level 0 by slices and integers, as a new array. Reads what covers them."""
        return read_indexed(index, self.shape, self.dtype, lambda box: self.read(0, box))

    def __len__(self):
        """Samples along z."""
        return self.shape[0]

    def __array__(self, dtype=None, copy=None):
        """All samples of level 0. Reads them each time."""
        samples = self.read()
        return samples if dtype is None else samples.astype(dtype, copy=False)

    def export(
        self, path, *, level=0, roi=None, format=None, isovalue=None, half_band=3, inside=None,
        force=False, memory=2**30, threads=0, progress=None,
    ):
        """Writes the samples of a level, bit for bit, or an OpenVDB level set of an isosurface.

        `format` is "raw", "nrrd", "vdb" or "zip"; None: by the extension (.raw, .bin, .nrrd,
        .vdb, .zip). A zip holds the whole store.
        `isovalue` is for .vdb: a level set with `half_band` voxels on either side.
        """
        path = path_text(path)
        format = format or _export_format(path)
        if format not in ("raw", "nrrd", "vdb", "zip"):
            raise UsageError(f"format must be 'raw', 'nrrd', 'vdb' or 'zip', not {format!r}")
        if isovalue is not None:
            isovalue = self.isovalue(isovalue) if isinstance(isovalue, str) else isovalue
            isovalue = number(isovalue, "isovalue")
        part = extract_options(
            0, level=level, box=box_of(roi, self._level(level).shape), inside=inside,
            memory=memory, threads=threads,
        )
        with reporting(progress) as report:
            self._native.export(
                path, format, part, isovalue, integer(half_band, "half_band", 1, 1000),
                bool(force), report
            )

    def _level(self, level):
        level = integer(level, "level")
        if not 0 <= level < len(self._levels):
            raise UsageError(f"there is no level {level}; the levels are 0 to {len(self._levels) - 1}")
        return self._levels[level]

    def _surface(self, isovalue, *, level=0, roi=None, progress=None, **options):
        """The request of a surface, for the C++ layer."""
        box = box_of(roi, self._level(level).shape)
        if isinstance(isovalue, str):
            isovalue = self.isovalue(isovalue, progress=progress)
        return extract_options(isovalue, level=level, box=box, **options)


def _export_format(path):
    formats = {".raw": "raw", ".bin": "raw", ".nrrd": "nrrd", ".vdb": "vdb", ".zip": "zip", ".ozx": "zip"}
    extension = os.path.splitext(path)[1].lower()
    if extension not in formats:
        raise UsageError(f"{path!r} is no volume that can be written: name it .nrrd, .vdb, .raw or .zip")
    return formats[extension]


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


def source_path(source):
    """The path of a file, or of a Zarr array or group on the disk."""
    if hasattr(source, "store") and hasattr(source, "path") and hasattr(source, "attrs"):
        source = _zarr_path(source)
    path = path_text(source)
    # The name of an array may follow that of its file: run.h5:/density.
    ends = [i for i in range(len(path)) if path.startswith(":/", i)] + [len(path)]
    if not any(os.path.exists(path[:end]) for end in ends):
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), path)
    return path


def _sample_type(dtype):
    native = check_dtype(dtype, "the file")
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
    source, *, cache=True, cache_limit=20 * 2**30, memory=2**30, threads=0, progress=None, **request
):
    """Opens a volume of any format as a `Volume`.

    A store is opened in place. Anything else is converted first, into a cache that later calls
    find.

    Parameters
    ----------
    source : str, path, or a zarr array or group on the disk
        A store or a zip of one, a file of a known format, a folder of slices, FILE:/NAME for an array in a file.
    cache : bool or path
        Where stores of other formats are kept: True for ~/.cache/isobrick, or a folder. False:
        they go with the volume.
    cache_limit : int or str
        Bytes of all stores in the cache.
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
            byte_count(memory), thread_count(threads), report,
        )
    volume = Volume(native)
    volume._opened = os.path.abspath(path), dict(
        request, cache=cache, cache_limit=cache_limit, memory=memory, threads=threads
    )
    return volume
