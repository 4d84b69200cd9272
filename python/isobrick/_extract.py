"""Surfaces of arrays."""

from ._arguments import (
    box_of, byte_count, extract_options, filter_options, histogram_bins, is_list,
    mesh_file_options, number, one_isovalue, path_text, thread_count,
)
from ._device import DeviceMesh, DeviceSamples, is_on_device
from ._errors import UsageError
from ._mesh import Mesh, with_measure
from ._progress import reporting
from ._samples import Samples
from ._volume import Histogram


class Extractor:
    """Isosurfaces of one array, for several isovalues.

    The first extraction finds the ranges of blocks of samples, and later ones skip what their
    isovalue does not touch. The mesh is the same as that of `isobrick.extract`.

    Parameters
    ----------
    array : array [z, y, x]
        Samples of uint8, int8, uint16, int16, uint32, int32, float32, float64 or bool. A NumPy
        array is read in place, whatever its strides, and must stay as it is while it is used.
        Anything else with `shape`, `dtype` and `__getitem__` (dask, zarr, h5py) is read by blocks,
        never as a whole. A `xarray.DataArray` gives spacing, origin and unit by its coordinates.
        An array in the memory of a CUDA device (PyTorch, CuPy, JAX, Numba) stays there: its
        surfaces are a `DeviceMesh`. It must stay as it is while the extractor is used.
    spacing, origin : three floats x, y, z, optional
        Distance between samples, and the place of sample [0, 0, 0], in world space.
    direction : 3×3 floats, optional
        A rotation. Its columns are the world directions of the index axes x, y, z.
    unit : str, optional
        Of world space, such as "mm".
    mask : array [z, y, x] of bool, optional
        Where it is False the sample is missing. No surface touches missing samples.
    nodata : float, optional
        Samples of this value are missing.
    stream : CUDA stream or its number, optional
        Of an array in device memory: what orders the work after that which makes the samples. By
        default the one that the array names, else the default stream.

    Arrays and all that indexes them (`shape`, `roi`) are in the order z, y, x. World space
    (`spacing`, `origin`, vertices) is in the order x, y, z, as in VTK, SimpleITK and nibabel.
    """

    def __init__(
        self, array, *, spacing=None, origin=None, direction=None, unit=None, mask=None,
        nodata=None, stream=None,
    ):
        if is_on_device(array):
            self._samples = DeviceSamples(
                array, spacing=spacing, origin=origin, direction=direction, unit=unit, mask=mask,
                nodata=nodata, stream=stream,
            )
            self._native = self._samples.native
            return
        if stream is not None:
            raise UsageError("stream is for arrays in the memory of a CUDA device")
        samples = Samples(
            array, spacing=spacing, origin=origin, direction=direction, unit=unit, mask=mask,
            nodata=nodata,
        )
        self._samples = samples
        self._native = samples.extractor()

    def __reduce__(self):
        raise TypeError("an Extractor cannot be pickled; pickle its array, and make another")

    @property
    def shape(self):
        """Samples along z, y, x."""
        return self._samples.shape

    @property
    def dtype(self):
        """The NumPy dtype of the samples."""
        return self._samples.dtype

    @property
    def range(self):
        """(smallest, largest) sample, missing ones left out.

        None before the first extraction, and of arrays in device memory.
        """
        return None if self._on_device else self._native.range

    @property
    def _on_device(self):
        return isinstance(self._samples, DeviceSamples)

    def isovalue(self, text, *, memory=2**30, threads=0, progress=None):
        """The isovalue that a text means, as of `Volume.isovalue`: "otsu", "p99.5", "50%", ….

        Where the samples matter, all are counted, once for all texts.
        """
        values = self.isovalues(text, memory=memory, threads=threads, progress=progress)
        return one_isovalue(text, values)

    def isovalues(self, text, *, memory=2**30, threads=0, progress=None):
        """The isovalues of a list or steps such as "100:500:50" or "otsu,p90"."""
        if not isinstance(text, str):
            return [number(text, "isovalue")]
        self._check_host("isovalues that depend on the samples")
        self._samples.set_memory(byte_count(memory))
        with reporting(progress) as report:
            return self._native.isovalues(text, thread_count(threads), report)

    def suggested_isovalue(self, *, memory=2**30, threads=0, progress=None):
        """(isovalue, why it is suggested), or None where all samples are equal."""
        self._check_host("a suggested isovalue")
        self._samples.set_memory(byte_count(memory))
        with reporting(progress) as report:
            return self._native.suggested_isovalue(thread_count(threads), report)

    def histogram(self, bins=64, *, memory=2**30, threads=0, progress=None):
        """The `Histogram` of all samples in at most so many bins. Missing samples count as NaN."""
        self._check_host("a histogram")
        self._samples.set_memory(byte_count(memory))
        with reporting(progress) as report:
            return Histogram(
                **self._native.histogram(histogram_bins(bins), thread_count(threads), report)
            )

    def extract(
        self, isovalue, *, roi=None, normals=False, inside="above", drop_degenerate=False,
        topology="consistent", cap=False, min_component=0, largest=0, smooth=0, pass_band=0.1,
        simplify=None, max_error=None, memory=2**30,
        threads=0, progress=None,
    ):
        """The surface of an isovalue as a `Mesh`, or a `DeviceMesh` of an array on a device.

        Parameters
        ----------
        isovalue : float, str, or a list of them
            In the values of the samples, or a text as of `isovalue()`, such as "otsu". A list
            gives a list of meshes.
        roi : slices [z, y, x], optional
            Only these samples, such as `numpy.s_[0:10, :, 5:]`.
        normals : bool
            Adds normals, from the gradient of the samples.
        inside : "above" or "below"
            Which samples are inside: those of at least the isovalue, or those less than it.
        drop_degenerate : bool
            Leaves triangles without area out.
        topology : "consistent" or "trilinear"
            How the surface passes where the corners of a cell allow several ways: by a rule for
            faces, or as the trilinear interpolant does; on a device not with ``drop_degenerate``.
        cap : bool
            Closes the surface at the border and around missing samples; neither on a device nor
            with `drop_degenerate`.
        min_component, largest, smooth, pass_band, simplify, max_error
            Filters of the mesh, as of `Volume.extract`; not on a device.
        memory : int or str
            Budget in bytes, or a text such as "512M", for all but the array and the mesh. It does
            not bound device memory.
        threads : int
            0: all cores.
        progress : function or tqdm, optional
            A function of (stage, done, total) in bytes, a tqdm bar, or the class `tqdm`.

        Raises UsageError (a ValueError) for a request that makes no sense.
        """
        filters = filter_options(
            min_component=min_component, largest=largest, smooth=smooth, pass_band=pass_band,
            simplify=simplify, max_error=max_error, threads=threads,
        )
        self._check_filters(filters)
        several = is_list(isovalue)
        requests = [
            self._surface(
                one, roi=roi, normals=normals, inside=inside, drop_degenerate=drop_degenerate,
                topology=topology, cap=cap, memory=memory, threads=threads, progress=progress,
            )
            for one in (isovalue if several else [isovalue])
        ]
        with reporting(progress) as report:
            meshes = [self._mesh(options, filters, report) for options in requests]
        return meshes if several else meshes[0]

    def save(
        self, path, isovalue, *, roi=None, normals=False, inside="above", drop_degenerate=False,
        topology="consistent", cap=False, min_component=0, largest=0, smooth=0, pass_band=0.1,
        simplify=None, max_error=None, measure=False,
        memory=2**30, threads=0, progress=None, force=False, quantize=False,
        compress=False,
    ):
        """Streams a surface to a mesh file, so that the mesh may be larger than memory.

        The arguments are those of `extract` and of `Mesh.save`. Returns the numbers of vertices
        and faces in a dictionary, and with `measure` a `Measure` of the mesh.
        """
        filters = filter_options(
            min_component=min_component, largest=largest, smooth=smooth, pass_band=pass_band,
            simplify=simplify, max_error=max_error, threads=threads,
            measure=measure,
        )
        options = self._surface(
            isovalue, roi=roi, normals=normals, inside=inside, drop_degenerate=drop_degenerate,
            topology=topology, cap=cap, memory=memory, threads=threads, progress=progress,
        )
        file = mesh_file_options(
            force=force, quantize=quantize, compress=compress, threads=threads, memory=memory
        )
        if self._on_device:
            raise UsageError("of an array in device memory, save extract(…).to_host()")
        with reporting(progress) as report:
            return with_measure(self._native.save(options, filters, path_text(path), file, report))

    def _mesh(self, options, filters, report):
        if self._on_device:
            return DeviceMesh(self._native.extract(options))
        return Mesh._of(self._native.extract(options, filters, report))

    def _check_filters(self, filters):
        if self._on_device and filters.any():
            raise UsageError(
                "meshes in device memory are not filtered; copy the array to the host, or leave out "
                "min_component, largest and smooth"
            )

    def _check_host(self, what):
        if self._on_device:
            raise UsageError(f"{what}: copy the array in device memory to the host")

    def _surface(
        self, isovalue, *, roi=None, memory=2**30, threads=0, progress=None, **options
    ):
        """The request of a surface, for the C++ layer."""
        if isinstance(isovalue, str):
            isovalue = self.isovalue(isovalue, memory=memory, threads=threads, progress=progress)
        options = extract_options(
            isovalue, box=box_of(roi, self.shape), memory=memory, threads=threads, **options
        )
        if not self._on_device:
            options.memory_of_others = self._samples.set_memory(options.memory)
        return options


def extract(
    array, isovalue, *, spacing=None, origin=None, direction=None, unit=None, mask=None,
    nodata=None, stream=None, roi=None, normals=False, inside="above", drop_degenerate=False,
    topology="consistent", cap=False, min_component=0, largest=0, smooth=0, pass_band=0.1,
    simplify=None, max_error=None, memory=2**30,
    threads=0, progress=None,
):
    """The isosurface of an array [z, y, x] as a `Mesh`, or a `DeviceMesh` of one on a device.

    A list of isovalues gives a list of meshes.

    Parameters
    ----------
    array, spacing, origin, direction, unit, mask, nodata, stream
        As of `Extractor`: arrays are indexed [z, y, x]; world space is x, y, z.
    isovalue, roi, normals, inside, drop_degenerate, topology, cap, memory, threads, progress
        As of `Extractor.extract`.
    min_component, largest, smooth, pass_band, simplify, max_error
        As of `Volume.extract`.

    Examples
    --------
    >>> import numpy as np, isobrick
    >>> z, y, x = np.mgrid[-1:1:64j, -1:1:64j, -1:1:64j]
    >>> ball = isobrick.extract(1 - np.sqrt(x**2 + y**2 + z**2), 0.5)
    >>> ball.faces.shape[1], ball.vertices.dtype
    (3, dtype('float32'))
    """
    extractor = Extractor(
        array, spacing=spacing, origin=origin, direction=direction, unit=unit, mask=mask,
        nodata=nodata, stream=stream,
    )
    return extractor.extract(
        isovalue, roi=roi, normals=normals, inside=inside, drop_degenerate=drop_degenerate,
        topology=topology, cap=cap, min_component=min_component, largest=largest, smooth=smooth,
        pass_band=pass_band, simplify=simplify, max_error=max_error, memory=memory,
        threads=threads, progress=progress,
    )
