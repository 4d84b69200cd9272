"""Volumes in files: stores, and whatever else the program opens."""

import os
from dataclasses import dataclass

import numpy as np

from . import _isobrick
from ._arguments import (
    attribute_name, box_of, byte_count, colour_arguments, extract_options, filter_options,
    histogram_bins, integer, is_list, label_options, mesh_file_options, number, one_isovalue,
    path_text, thread_count, unit_text,
)
from ._device import DeviceMesh, DeviceVolume, stream_number
from ._errors import UsageError
from ._indexing import read_indexed
from ._mesh import Mesh, meshes_of, with_measure
from ._pieces import part_numbers
from ._progress import reporting


def _attribute_volumes(attributes):
    """The volumes that a mesh takes its attributes from, by names."""
    from ._open import open

    volumes = {}
    for name, other in (attributes or {}).items():
        volumes[attribute_name(name)] = other if isinstance(other, Volume) else open(other)
    _isobrick.check_attribute_names(list(volumes))
    return volumes


def _with_samples(mesh, volumes, threads):
    """The mesh with the values of volumes at its vertices."""
    for name, volume in volumes.items():
        mesh.attributes[name] = volume.sample(mesh, threads=threads)
    return mesh


def _stream(stream):
    """The number of a stream; 0: the default one."""
    return 0 if stream is None else stream_number(stream)


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

    Arrays and all that indexes them are in the order z, y, x; world space is x, y, z. A pickle has
    the path and is opened again.
    """

    def __init__(self, native, reopen=None):
        """A native volume, and how a pickle opens it: a function with its arguments."""
        self._native = native
        self._reopen = reopen
        self._info = native.info
        self._levels = tuple(
            Level(**{**level, "direction": tuple(level["direction"])})
            for level in self._info["levels"]
        )

    def __reduce__(self):
        return self._reopen

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
        """The `Histogram` in so many bins at most: the stored one, else of a small level."""
        with reporting(progress) as report:
            return Histogram(**self._native.histogram(histogram_bins(bins), report))

    def extract(
        self, isovalue, *, level=0, roi=None, normals=False, inside=None, drop_degenerate=False,
        topology="consistent", cap=False, min_component=0, largest=0, smooth=0, pass_band=0.1,
        simplify=None, max_error=None, backend="auto",
        memory=2**30, threads=0, gpu_memory=0, device=0, progress=None, attributes=None,
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
            faces, or as the trilinear interpolant does; with ``drop_degenerate`` on the CPU.
        cap : bool
            Closes the surface at the border and around missing samples; on the CPU, and not with
            `drop_degenerate`.
        min_component : int
            Drops components with fewer triangles.
        largest : int
            Keeps so many components, those with most triangles; 0: all.
        smooth : int
            Iterations of smoothing that keeps the size (Taubin); open borders stay where they are.
        pass_band : float
            Of the smoothing: what varies more along the surface goes, from 0, all, to 0.8, little.
        simplify : float or int, optional
            A part of the triangles in (0, 1], or their number: flat parts lose more than others.
        max_error : float, optional
            Of the simplification: how far the mesh may be from the original, in `unit`. Without
            `simplify`: as few triangles as this permits.
        backend : "auto", "cpu" or "cuda"
            What makes the surface; the mesh is the same.
        memory, gpu_memory : int or str
            Budgets in bytes, or texts such as "512M", for all but the mesh.
        threads : int
            0: all cores.
        progress : function or tqdm, optional
            A function of (stage, done, total) in bytes, a tqdm bar, or the class `tqdm`.
        attributes : dict, optional
            Volumes to sample at the vertices, by names: `Volume` or a path. `Mesh.attributes` has
            the values, as of `sample()`.
        """
        others = _attribute_volumes(attributes)
        request = dict(
            level=level, roi=roi, normals=normals, inside=inside,
            drop_degenerate=drop_degenerate, topology=topology, cap=cap, backend=backend,
            memory=memory, threads=threads, gpu_memory=gpu_memory, device=device,
            progress=progress,
        )
        filters = filter_options(
            min_component=min_component, largest=largest, smooth=smooth, pass_band=pass_band,
            simplify=simplify, max_error=max_error, threads=threads,
        )
        if is_list(isovalue):
            meshes = self._extract_several(isovalue, request, filters)
            return [_with_samples(mesh, others, threads) for mesh in meshes]
        options = self._surface(isovalue, **request)
        with reporting(progress) as report:
            mesh = Mesh._of(self._native.extract(options, filters, report))
        return _with_samples(mesh, others, threads)

    def extract_to_device(
        self, isovalue, *, level=0, roi=None, normals=False, inside=None, device=0, gpu_memory=0,
        memory=2**30, threads=0, stream=None, progress=None,
    ):
        """The surface of an isovalue as a `DeviceMesh`: the mesh of `extract`, on a CUDA device.

        Only the bricks that the surface touches are read; packed ones are decoded on the device.

        Parameters
        ----------
        isovalue, level, roi, normals, inside, memory, threads, progress
            As of `extract`.
        device : int
            Of the CUDA devices, from 0.
        gpu_memory : int or str
            Budget of device memory in bytes, or a text such as "8G"; 0: what the device has.
        stream : optional
            A stream of PyTorch, CuPy or Numba, or a number, that the work and the mesh belong to.
        """
        options = self._surface(
            isovalue, level=level, roi=roi, normals=normals, inside=inside, device=device,
            gpu_memory=gpu_memory, memory=memory, threads=threads, progress=progress,
        )
        with reporting(progress) as report:
            return DeviceMesh(
                _isobrick.extract_to_device(self._native, options, _stream(stream), report)
            )

    def to_device(
        self, *, level=0, roi=None, device=0, gpu_memory=0, memory=2**30, threads=0, stream=None,
        progress=None,
    ):
        """Reads a level, or a region of it, to a CUDA device, for any number of isovalues.

        Returns a `DeviceVolume`. The parameters are those of `extract_to_device`.
        """
        options = self._surface(
            0, level=level, roi=roi, device=device, gpu_memory=gpu_memory, memory=memory,
            threads=threads, progress=progress,
        )
        with reporting(progress) as report:
            native = _isobrick.DeviceExtractor.of_volume(
                self._native, options, _stream(stream), report
            )
        return DeviceVolume(native, self, {"level": level, "gpu_memory": gpu_memory})

    def extract_labels(
        self, labels=None, *, level=0, roi=None, background=0, smooth=0, pass_band=0.1,
        memory=2**30, threads=0, progress=None,
    ):
        """The meshes of labels: a dictionary from labels to `Mesh`. See `isobrick.extract_labels`.

        All meshes are in memory; `isobrick extract --labels` streams them to files.
        """
        options = label_options(
            labels, background=background, level=level,
            box=box_of(roi, self._level(level).shape), smooth=smooth, pass_band=pass_band,
            memory=memory, threads=threads,
        )
        with reporting(progress) as report:
            return meshes_of(self._native.extract_labels(options, report))

    def sample(self, points, *, unit=None, memory=2**26, threads=0):
        """The values at points of world space, by trilinear interpolation, as float32.

        Parameters
        ----------
        points : array [n, 3], or Mesh
            Rows x, y, z, such as the vertices of a mesh of another volume.
        unit : str, optional
            Of the points, where it is not that of the volume. A mesh has its own.
        memory : int or str
            Bytes for decoded bricks: points cost least where neighbours follow each other.
        threads : int
            0: all cores.

        Level 0 is sampled. NaN outside of the volume, which ends at its first and last samples.
        """
        if isinstance(points, Mesh):
            unit = points.unit if unit is None else unit
            points = points.vertices
        points = np.ascontiguousarray(points, dtype="float32")
        if points.ndim != 2 or points.shape[1] != 3:
            raise UsageError(f"points must be rows of x, y, z, not of shape {points.shape}")
        return self._native.sample(
            points, unit_text(unit or ""), byte_count(memory), thread_count(threads)
        )

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
        drop_degenerate=False, topology="consistent", cap=False, min_component=0, largest=0,
        smooth=0, pass_band=0.1, simplify=None, max_error=None, measure=False, backend="auto",
        memory=2**30, threads=0, gpu_memory=0, device=0, progress=None, force=False,
        quantize=False, compress=False, attributes=None, colour_by=None, colour_map=None,
    ):
        """Streams a surface to a mesh file, so that volume and mesh may be larger than memory.

        The arguments are those of `extract` and of `Mesh.save`; `colour_by` without a range reaches
        over all samples of the attribute's volume. Returns a dictionary of what was
        done: vertices, faces, bricks, bricks_read, bytes_read, backend, seconds, and with
        `measure` a `Measure` of the mesh.
        """
        filters = filter_options(
            min_component=min_component, largest=largest, smooth=smooth, pass_band=pass_band,
            simplify=simplify, max_error=max_error, threads=threads,
            measure=measure,
        )
        options = self._surface(
            isovalue, progress=progress, level=level, roi=roi, normals=normals, inside=inside,
            drop_degenerate=drop_degenerate, topology=topology, cap=cap, backend=backend,
            memory=memory, threads=threads, gpu_memory=gpu_memory, device=device,
        )
        file = mesh_file_options(
            force=force, quantize=quantize, compress=compress, threads=threads, memory=memory
        )
        others = _attribute_volumes(attributes)
        colours = colour_arguments(
            colour_by, colour_map, others, lambda name: others[name].range
        )
        with reporting(progress) as report:
            return with_measure(
                self._native.save_mesh(
                    options, filters, path_text(path), file,
                    [(name, other._native) for name, other in others.items()], colours, report,
                )
            )

    def extract_piece(
        self, isovalue, path, part, *, level=0, roi=None, normals=False, inside=None,
        drop_degenerate=False, topology="consistent", cap=False, memory=2**30, threads=0,
        progress=None, force=False,
    ):
        """One part of a surface, as a file that `isobrick.merge` puts together with the others.

        Tasks on many machines may each make a part; they need to know nothing of each other.

        Parameters
        ----------
        isovalue, level, roi, normals, inside, drop_degenerate, topology, cap
            As of `extract`, the same for all parts.
        path : str or path
            The piece, such as "ct_3of8.piece". One that is there, whole and the same, is kept.
        part : (int, int)
            Which part of how many: (3, 8) is the third of eight.
        memory, threads, progress
            As of `extract`.
        force : bool
            Replaces a file that is no piece.

        Made on the CPU. Returns a dictionary: vertices, faces, bytes, and whether it was kept.
        """
        options = self._surface(
            isovalue, progress=progress, level=level, roi=roi, normals=normals, inside=inside,
            drop_degenerate=drop_degenerate, topology=topology, cap=cap, memory=memory,
            threads=threads,
        )
        with reporting(progress) as report:
            return _isobrick.extract_piece(
                self._native, options, *part_numbers(part), path_text(path), bool(force), report
            )

    def extract_label_piece(
        self, path, part, labels=None, *, level=0, roi=None, background=0, smooth=0, pass_band=0.1,
        memory=2**30, threads=0, progress=None, force=False,
    ):
        """What a part of the volume has of all labels, as a file for `isobrick.merge_labels`.

        Tasks on many machines may each make a part; they need to know nothing of each other.

        Parameters
        ----------
        path : str or path
            The piece, such as "cells_3of8.piece". One that is there, whole and the same, is kept.
        part : (int, int)
            Which part of how many: (3, 8) is the third of eight.
        labels, level, roi, background, smooth, pass_band
            As of `extract_labels`, the same for all parts.
        memory, threads, progress
            As of `extract_labels`.
        force : bool
            Replaces a file that is no piece.

        Returns a dictionary: vertices, faces, bytes, and whether it was kept.
        """
        options = label_options(
            labels, background=background, level=level,
            box=box_of(roi, self._level(level).shape), smooth=smooth, pass_band=pass_band,
            memory=memory, threads=threads,
        )
        with reporting(progress) as report:
            return _isobrick.extract_label_piece(
                self._native, options, *part_numbers(part), path_text(path), bool(force), report
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
            last = len(self._levels) - 1
            raise UsageError(f"there is no level {level}; the levels are 0 to {last}")
        return self._levels[level]

    def _surface(self, isovalue, *, level=0, roi=None, progress=None, **options):
        """The request of a surface, for the C++ layer."""
        box = box_of(roi, self._level(level).shape)
        if isinstance(isovalue, str):
            isovalue = self.isovalue(isovalue, progress=progress)
        return extract_options(isovalue, level=level, box=box, **options)


_EXPORT_FORMATS = {
    ".raw": "raw", ".bin": "raw", ".nrrd": "nrrd", ".vdb": "vdb", ".zip": "zip", ".ozx": "zip",
}


def _export_format(path):
    extension = os.path.splitext(path)[1].lower()
    if extension not in _EXPORT_FORMATS:
        raise UsageError(
            f"{path!r} is no volume that can be written: name it .nrrd, .vdb, .raw or .zip"
        )
    return _EXPORT_FORMATS[extension]
