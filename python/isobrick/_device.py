"""Samples in the memory of a CUDA device, and the meshes that are made there."""

import numpy as np

from . import _isobrick
from ._arguments import box_of, extract_options, is_list, transform
from ._errors import UsageError
from ._mesh import Mesh

_CUDA, _MANAGED = 2, 13  # of DLPack
_LEGACY_STREAM = 1  # of both protocols


def is_on_device(array):
    """Whether an array of another library is in the memory of a CUDA device."""
    return hasattr(array, "__cuda_array_interface__") or (
        not isinstance(array, np.ndarray)
        and hasattr(array, "__dlpack_device__")
        and array.__dlpack_device__()[0] in (_CUDA, _MANAGED)
    )


def stream_number(stream):
    """A cudaStream_t, from a number or a stream of PyTorch, CuPy or Numba."""
    for name in ("cuda_stream", "ptr", "handle"):
        stream = getattr(stream, name, stream)
    try:
        return int(getattr(stream, "value", stream))
    except (TypeError, ValueError):
        raise TypeError(f"stream must be a CUDA stream, not {stream!r}") from None


def _check_shape(shape):
    if len(shape) != 3:
        raise UsageError(f"array must have three axes [z, y, x], not {len(shape)} (shape {shape})")


class DeviceSamples:
    """An array [z, y, x] in device memory, and its place in world space."""

    def __init__(self, array, *, spacing, origin, direction, unit, mask, nodata, stream):
        if mask is not None or nodata is not None:
            raise UsageError("arrays in device memory take no mask and no nodata; use NaN instead")
        place = transform(spacing, origin, direction, unit or "")
        stream = None if stream is None else stream_number(stream)
        if hasattr(array, "__cuda_array_interface__"):
            self.native = self._of_interface(array.__cuda_array_interface__, place, stream)
        else:
            _check_shape(tuple(array.shape))
            stream = stream or _LEGACY_STREAM
            self.native = _isobrick.DeviceExtractor.of_capsule(
                array.__dlpack__(stream=stream), place, stream
            )
        self.array = array  # which the extractor reads
        self.shape = self.native.shape
        self.dtype = np.dtype(self.native.dtype)

    @staticmethod
    def _of_interface(interface, place, stream):
        shape, typestr = tuple(interface["shape"]), interface["typestr"]
        _check_shape(shape)
        dtype = np.dtype(typestr)
        if not dtype.isnative:
            raise UsageError(f"array has the byte order of another machine (dtype {typestr!r})")
        if interface.get("mask") is not None:
            raise UsageError("masks of __cuda_array_interface__ are not supported")
        if stream is None:
            stream = interface.get("stream") or _LEGACY_STREAM
        return _isobrick.DeviceExtractor.of_pointer(
            interface["data"][0], shape, interface.get("strides"), dtype.kind, dtype.itemsize,
            place, stream,
        )


class DeviceVolume:
    """A level of a volume whose samples were read to the memory of a CUDA device.

    `isobrick.Volume.to_device` makes it. Any number of isovalues are then extracted without the
    disk and the bus; samples and meshes stay on the device. `shape` [z, y, x] and `dtype` are
    those of the level.
    """

    __slots__ = ("_native", "_volume", "_options", "shape", "dtype")

    def __init__(self, native, volume, options):
        self._native = native
        self._volume = volume  # which knows what texts stand for as isovalues
        self._options = options
        self.shape = tuple(native.shape)
        self.dtype = np.dtype(native.dtype)

    def extract(self, isovalue, *, roi=None, normals=False, inside=None, progress=None):
        """The surface of an isovalue as a `DeviceMesh`; the mesh of `Volume.extract`.

        Parameters
        ----------
        isovalue : float, str, or a list of them
            A number, or a text as of `Volume.isovalue()`, such as "otsu". A list gives a list of
            meshes.
        roi : slices [z, y, x], optional
            Only these samples, within those that were read.
        normals : bool
            Adds normals, from the gradient of the samples.
        inside : "above", "below" or None
            Which samples are inside. None: below in a level set, else above.
        progress : function or tqdm, optional
            Of finding an isovalue for a text.
        """
        if is_list(isovalue):
            return [
                self.extract(one, roi=roi, normals=normals, inside=inside, progress=progress)
                for one in isovalue
            ]
        options = extract_options(
            self._volume.isovalue(isovalue, progress=progress), box=box_of(roi, self.shape),
            normals=normals, inside=inside, **self._options,
        )
        return DeviceMesh(self._native.extract(options))

    def __repr__(self):
        return f"<isobrick.DeviceVolume: shape {self.shape}, {self.dtype}>"


class DeviceRows:
    """An array (N, 3) of a mesh in device memory, for `torch.as_tensor`, `cupy.asarray`, ….

    It is passed on without a copy by `__cuda_array_interface__` and `__dlpack__`, and keeps the
    mesh's memory alive.
    """

    __slots__ = ("_native", "_name", "shape", "dtype", "_pointer")

    def __init__(self, native, name):
        self._native = native
        self._name = name
        self._pointer, rows = native.rows(name)
        self.shape = (rows, 3)
        self.dtype = np.dtype(np.uint32 if name == "faces" else np.float32)

    def __len__(self):
        return self.shape[0]

    def __repr__(self):
        return f"<isobrick.DeviceRows: {self._name}, shape {self.shape}, {self.dtype}>"

    @property
    def __cuda_array_interface__(self):
        return {
            "shape": self.shape,
            "typestr": self.dtype.str,
            "data": (self._pointer, False),
            "strides": None,
            "version": 3,
            "stream": self._native.stream or _LEGACY_STREAM,
        }

    def __dlpack_device__(self):
        return _CUDA, max(0, self._native.device)

    def __dlpack__(self, *, stream=None, max_version=None, dl_device=None, copy=None):
        if copy:
            raise BufferError("a mesh in device memory is passed on without a copy")
        # −1: the consumer wants no synchronisation.
        number = None if stream == -1 else stream or _LEGACY_STREAM
        return self._native.dlpack(self._name, number)


class DeviceMesh:
    """A triangle mesh in the memory of a CUDA device.

    Attributes
    ----------
    vertices : (N, 3) float32
        Positions x, y, z in world space.
    normals : (N, 3) float32 or None
        Unit vectors x, y, z from the inside out, where normals were requested.
    faces : (M, 3) uint32
        Numbers of vertices, counter-clockwise seen from outside.
    device : int
        The number of the device; −1 for an empty mesh.

    The arrays go to PyTorch, CuPy, JAX and Numba without copies, by `__dlpack__` and
    `__cuda_array_interface__`, and each keeps the memory alive:
    `torch.from_dlpack(mesh.vertices)`. The device may still be writing them when `extract`
    returns; both protocols tell the consumer what to wait for.
    """

    __slots__ = ("_native",)

    def __init__(self, native):
        self._native = native

    @property
    def vertices(self):
        """Positions (N, 3) float32, x, y, z in world space."""
        return DeviceRows(self._native, "vertices")

    @property
    def normals(self):
        """Unit vectors (N, 3) float32 from the inside out, or None."""
        normals = DeviceRows(self._native, "normals")
        return normals if len(normals) or not len(self.vertices) else None

    @property
    def faces(self):
        """Triangles (M, 3) uint32, counter-clockwise seen from outside."""
        return DeviceRows(self._native, "faces")

    @property
    def device(self):
        """The number of the CUDA device; −1 for an empty mesh."""
        return self._native.device

    def to_host(self):
        """A copy as `isobrick.Mesh`."""
        return Mesh._of(self._native.download())

    def __len__(self):
        """The number of triangles."""
        return len(self.faces)

    def __repr__(self):
        return (
            f"<isobrick.DeviceMesh: {len(self.vertices):,} vertices, {len(self):,} triangles, "
            f"device {self.device}>"
        )
