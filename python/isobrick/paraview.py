"""The classes of the plugin of ParaView, share/isobrick/paraview/isobrick.xml.

IsobrickSurface gives surfaces as vtkPolyData, IsobrickVolume gives samples as vtkImageData. Both
take what isobrick.open takes. World space is x, y, z.
"""

import math
import os

import numpy as np
from vtkmodules.util.numpy_support import get_vtk_array_type, numpy_to_vtk
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonCore import vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkImageData, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm, vtkStreamingDemandDrivenPipeline

from paraview import print_error

from . import _volume
from ._arguments import byte_count
from ._mesh import Mesh

_PIPELINE = vtkStreamingDemandDrivenPipeline


class _Aborted(Exception):
    """Ends an operation that the user has aborted."""


class _VolumeSource(VTKPythonAlgorithmBase):
    """What both sources share: the volume, its level and region, progress and errors."""

    def __init__(self, output_type):
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType=output_type)
        self._volume = None
        self._file_name = ""
        self._channel = -1
        self._time = -1
        self._level = -1
        self._region = (0.0,) * 6
        self._memory = "1G"
        self._error = ""

    def SetFileName(self, name):
        self._set("_file_name", "" if name in (None, "None") else name, reopen=True)

    def SetChannel(self, channel):
        self._set("_channel", channel, reopen=True)

    def SetTime(self, time):
        self._set("_time", time, reopen=True)

    def SetLevel(self, level):
        self._set("_level", level)

    def SetRegion(self, *bounds):
        self._set("_region", bounds)

    def SetMemory(self, memory):
        self._set("_memory", memory)

    def RequestInformation(self, request, inputs, outputs):
        # An error is reported with the data, since more properties may be set before.
        self._error = self._run(self._describe, outputs.GetInformationObject(0))
        return 1  # 0 would make the pipeline add an error of many lines

    def RequestData(self, request, inputs, outputs):
        information = outputs.GetInformationObject(0)
        error = self._error
        if error is None:
            error = self._run(self._produce, information)
        if error is not None:
            information.Get(vtkDataObject.DATA_OBJECT()).Initialize()
        if error:
            print_error(f"Isobrick: {error}")
        return 1

    def _set(self, name, value, reopen=False):
        if getattr(self, name) != value:
            setattr(self, name, value)
            if reopen:
                self._volume = None
            self.Modified()

    def _run(self, function, information):
        """Calls a step of the pipeline once the volume is open.

        Returns None, or what went wrong in one line; "" for an abort, or for lack of a name.
        """
        if not self._file_name:
            return ""  # a source that has just been made
        try:
            self._open()
            function(information)
        except _Aborted:
            return ""
        except (OSError, MemoryError, RuntimeError, TypeError, ValueError) as error:
            text = getattr(error, "strerror", None) or str(error) or type(error).__name__
            return text if self._file_name in text else f"{self._file_name}: {text}"
        return None

    def _open(self):
        if self._volume is None:
            chosen = {"channel": self._channel, "time": self._time}
            self._volume = _volume.open(
                self._file_name, memory=self._memory, progress=self._progress(),
                **{name: number for name, number in chosen.items() if number >= 0},
            )

    def _progress(self, part=0, parts=1):
        """Reports the part-th operation of so many to ParaView, which may abort it."""

        def report(stage, done, total):
            self.SetProgressText(stage)
            self.UpdateProgress((part + (min(done / total, 1) if total else 0)) / parts)
            if self.GetAbortExecute():
                raise _Aborted

        return report

    def _checked_level(self):
        count = len(self._volume.levels)
        if self._level >= count:
            raise ValueError(f"there is no level {self._level}; the levels are 0 to {count - 1}")
        return self._level

    def _box(self, number):
        """The samples [z, y, x] of a level that cover the region, as (lo, hi), half-open."""
        level = self._volume.levels[number]
        shape = level.shape[::-1]
        rotation = np.reshape(level.direction, (3, 3))
        scale, origin = np.array(level.spacing), np.array(level.origin)
        corners = np.array(list(np.ndindex(2, 2, 2)))
        world = (corners * (np.array(shape) - 1) * scale) @ rotation.T + origin
        bounds = np.array([world.min(axis=0), world.max(axis=0)])
        for axis, (least, largest) in enumerate(zip(self._region[::2], self._region[1::2])):
            if not least <= largest:
                raise ValueError(f"the region {self._region} is empty")
            if least < largest:
                bounds[:, axis] = least, largest
        asked = np.array([[bounds[c[axis], axis] for axis in range(3)] for c in corners])
        index = ((asked - origin) @ rotation) / scale
        lo, hi, last = index.min(axis=0), index.max(axis=0), np.array(shape) - 1
        if (lo > last + 1e-6).any() or (hi < -1e-6).any():
            raise ValueError(
                f"the region {self._region} does not touch the volume, which reaches from "
                f"{tuple(world.min(axis=0))} to {tuple(world.max(axis=0))}"
            )
        # A bound at a sample means that sample, however it was rounded.
        begin = np.floor(np.clip(lo + 1e-6, 0, last)).astype(int)
        end = np.ceil(np.clip(hi - 1e-6, 0, last)).astype(int) + 1
        return begin[::-1].tolist(), end[::-1].tolist()

    def _describe_volume(self, data, level):
        """Adds name, unit and level to the field data."""
        for name, text in (("name", os.path.basename(self._file_name.rstrip("/"))),
                           ("unit", self._volume.unit)):
            array = vtkStringArray()
            array.SetName(name)
            array.InsertNextValue(text)
            data.GetFieldData().AddArray(array)
        _add_numbers(data.GetFieldData(), "level", np.array([level], np.int32))


class IsobrickSurface(_VolumeSource):
    """Isosurfaces of a volume as one vtkPolyData.

    Point data: Normals, and isovalue where there are several. Field data: name, unit, level and
    isovalues. Each of several ranks makes its own part of the surface.
    """

    def __init__(self):
        super().__init__("vtkPolyData")
        self._isovalues = "otsu"
        self._max_triangles = 5_000_000
        self._coarse_to_fine = False
        self._normals = True

    def SetIsovalues(self, isovalues):
        self._set("_isovalues", isovalues)

    def SetMaxTriangles(self, count):
        self._set("_max_triangles", count)

    def SetCoarseToFine(self, on):
        self._set("_coarse_to_fine", bool(on))

    def SetNormals(self, on):
        self._set("_normals", bool(on))

    def _describe(self, information):
        information.Set(vtkAlgorithm.CAN_HANDLE_PIECE_REQUEST(), 1)
        information.Remove(_PIPELINE.TIME_STEPS())
        information.Remove(_PIPELINE.TIME_RANGE())
        if self._coarse_to_fine:
            last = len(self._volume.levels) - 1 - self._finest_level(self._numbers())
            information.Set(_PIPELINE.TIME_STEPS(), [float(i) for i in range(last + 1)], last + 1)
            information.Set(_PIPELINE.TIME_RANGE(), [0.0, float(last)], 2)

    def _produce(self, information):
        isovalues = self._numbers()
        level = self._finest_level(isovalues)
        if self._coarse_to_fine:
            step = information.Get(_PIPELINE.UPDATE_TIME_STEP()) or 0.0
            level = max(level, len(self._volume.levels) - 1 - max(0, math.floor(step + 0.5)))
        roi = self._piece(
            level, information.Get(_PIPELINE.UPDATE_PIECE_NUMBER()) or 0,
            information.Get(_PIPELINE.UPDATE_NUMBER_OF_PIECES()) or 1,
        )
        meshes = []
        if roi is not None:
            for number, isovalue in enumerate(isovalues):
                meshes.append(self._volume.extract(
                    isovalue, level=level, roi=roi, normals=self._normals, memory=self._memory,
                    progress=self._progress(number, len(isovalues)),
                ))
        data = _joined(meshes).to_vtk() if meshes else vtkPolyData()
        if len(isovalues) > 1 and meshes:
            counts = [len(mesh.vertices) for mesh in meshes]
            _add_numbers(data.GetPointData(), "isovalue", np.repeat(np.float64(isovalues), counts))
            data.GetPointData().SetActiveScalars("isovalue")
        self._describe_volume(data, level)
        _add_numbers(data.GetFieldData(), "isovalues", np.array(isovalues, np.float64))
        vtkPolyData.GetData(information).ShallowCopy(data)

    def _numbers(self):
        return self._volume.isovalues(self._isovalues, progress=self._progress())

    def _finest_level(self, isovalues):
        """The level that was asked for, or the finest with few triangles, else the coarsest."""
        if self._checked_level() >= 0:
            return self._level
        for level in range(len(self._volume.levels) - 1):
            roi = _slices(*self._box(level))
            faces = sum(
                self._volume.estimate(value, level=level, roi=roi)["faces"] for value in isovalues
            )
            if faces <= self._max_triangles:
                return level
        return len(self._volume.levels) - 1

    def _piece(self, level, piece, pieces):
        """The samples of a piece: layers of cells along z. None where there are too few."""
        lo, hi = self._box(level)
        cells = hi[0] - 1 - lo[0]
        begin, end = cells * piece // pieces, cells * (piece + 1) // pieces
        if begin == end:
            return None
        return _slices([lo[0] + begin, *lo[1:]], [lo[0] + end + 1, *hi[1:]])


class IsobrickVolume(_VolumeSource):
    """Samples of a level as vtkImageData. Reads the extent that the pipeline requests, no more."""

    def __init__(self):
        super().__init__("vtkImageData")

    def _describe(self, information):
        number = self._chosen_level()
        level = self._volume.levels[number]
        information.Set(vtkAlgorithm.CAN_PRODUCE_SUB_EXTENT(), 1)
        information.Set(_PIPELINE.WHOLE_EXTENT(), _extent(*self._box(number)), 6)
        information.Set(vtkDataObject.SPACING(), level.spacing, 3)
        information.Set(vtkDataObject.ORIGIN(), level.origin, 3)
        information.Set(vtkDataObject.DIRECTION(), level.direction, 9)
        vtkDataObject.SetPointDataActiveScalarInfo(
            information, get_vtk_array_type(self._volume.dtype), 1
        )

    def _produce(self, information):
        number = self._chosen_level()
        level = self._volume.levels[number]
        extent = information.Get(_PIPELINE.UPDATE_EXTENT())
        data = vtkImageData.GetData(information)
        data.SetExtent(extent)
        data.SetSpacing(level.spacing)
        data.SetOrigin(level.origin)
        data.SetDirectionMatrix(level.direction)
        self._describe_volume(data, number)
        lo, hi = extent[4::-2], [last + 1 for last in extent[5::-2]]
        if all(begin < end for begin, end in zip(lo, hi)):
            samples = self._volume.read(number, _slices(lo, hi))
            _add_numbers(data.GetPointData(), "samples", samples.ravel())
            data.GetPointData().SetActiveScalars("samples")

    def _chosen_level(self):
        if self._checked_level() >= 0:
            return self._level
        budget = byte_count(self._memory)
        for number in range(len(self._volume.levels) - 1):
            lo, hi = self._box(number)
            if math.prod(np.subtract(hi, lo).tolist()) * self._volume.dtype.itemsize <= budget:
                return number
        return len(self._volume.levels) - 1


def _slices(lo, hi):
    return tuple(slice(begin, end) for begin, end in zip(lo, hi))


def _extent(lo, hi):
    """VTK's extent, x first, of a box [z, y, x]."""
    return [bound for begin, end in zip(lo[::-1], hi[::-1]) for bound in (begin, end - 1)]


def _add_numbers(attributes, name, numbers):
    """Adds an array that shares the memory of NumPy's and keeps it alive."""
    array = numpy_to_vtk(numbers)
    array.SetName(name)
    attributes.AddArray(array)


def _joined(meshes):
    """One mesh of several."""
    if len(meshes) == 1:
        return meshes[0]
    first = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    if first[-1] > 2**32:
        raise ValueError(f"{first[-1]} vertices are too many for one mesh: choose a coarser level")
    normals = [mesh.normals for mesh in meshes if mesh.normals is not None]
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + np.uint32(n) for mesh, n in zip(meshes, first)]),
        np.concatenate(normals) if len(normals) == len(meshes) else None,
        unit=meshes[0].unit,
    )
