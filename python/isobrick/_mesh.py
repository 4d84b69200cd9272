"""Meshes in memory."""

from dataclasses import dataclass
from typing import Optional

import numpy as np

from . import _isobrick
from ._arguments import (
    attribute_name, colour_arguments, filter_options, mesh_file_options, path_text, unit_text,
)
from ._errors import UsageError
from ._progress import reporting


@dataclass(frozen=True)
class Measure:
    """What a mesh measures, in its unit of length.

    `vertices` are those that triangles name. `components` are parts of which no two share a vertex.
    `open_sides` are sides of triangles that no other triangle has in reverse. `volume` is what the
    mesh encloses, negative where it is inside out, or None where it is open. `euler_number` is
    vertices less sides plus faces: 2 for a sphere, 0 for a torus. `bounds` are ((x, y, z),
    (x, y, z)), the smallest and the largest coordinates, or None without vertices.
    """

    vertices: int
    faces: int
    area: float
    volume: Optional[float]
    open_sides: int
    components: int
    euler_number: int
    bounds: Optional[tuple]
    unit: str

    @property
    def closed(self):
        """Whether no side is open."""
        return self.open_sides == 0


class Mesh:
    """A triangle mesh in memory, as NumPy arrays without copies.

    `Mesh(vertices, faces, normals=None, unit="", attributes=None)` copies arrays of others.

    Attributes
    ----------
    vertices : (N, 3) float32
        Positions x, y, z in world space, in `unit`.
    normals : (N, 3) float32 or None
        Unit vectors x, y, z from the inside out, where normals were requested.
    faces : (M, 3) uint32
        Numbers of vertices, counter-clockwise seen from outside.
    unit : str
        Of the vertices, such as "millimeter"; empty where it is not known.
    attributes : dict of (N,) float32
        Values at the vertices by their names, such as samples of other volumes. The dictionary can be
        changed; NaN means unknown.

    The arrays lie in the memory of the mesh and keep it alive. They can be changed, and
    other libraries take them without copies (`__dlpack__`, `__array_interface__`).
    """

    __slots__ = ("_native", "_attributes")

    def __init__(self, vertices, faces, normals=None, *, unit="", attributes=None):
        faces = np.asarray(faces)
        if faces.size and (faces.dtype.kind not in "ui" or faces.min() < 0):
            raise TypeError("faces must be numbers of vertices, integers of at least 0")
        if faces.size and int(faces.max()) >= len(vertices):
            raise ValueError(f"a face names vertex {faces.max()}, of {len(vertices)} vertices")
        self._native = _isobrick.Mesh(
            np.ascontiguousarray(vertices, np.float32),
            np.ascontiguousarray(faces, np.uint32),
            None if normals is None else np.ascontiguousarray(normals, np.float32),
            unit_text(unit),
        )
        self._attributes = {
            name: np.array(values, np.float32) for name, values in (attributes or {}).items()
        }

    @classmethod
    def _of(cls, native):
        mesh = cls.__new__(cls)
        mesh._native = native
        mesh._attributes = {}
        return mesh

    def __reduce__(self):
        return _rebuilt, (
            self.vertices, self.faces, self.normals, self.unit, self._attributes
        )

    @property
    def vertices(self):
        """Positions (N, 3) float32, x, y, z in world space."""
        return self._native.vertices

    @property
    def normals(self):
        """Unit vectors (N, 3) float32 from the inside out, or None."""
        normals = self._native.normals
        return normals if len(normals) or not len(self._native.vertices) else None

    @property
    def faces(self):
        """Triangles (M, 3) uint32, counter-clockwise seen from outside."""
        return self._native.faces

    @property
    def unit(self):
        """The unit of the vertices, such as "millimeter", or ""."""
        return self._native.unit

    @property
    def attributes(self):
        """Values (N,) float32 at the vertices, by their names. The dictionary can be changed."""
        return self._attributes

    def __len__(self):
        """The number of triangles."""
        return len(self.faces)

    def __repr__(self):
        parts = [f"{len(self.vertices):,} vertices", f"{len(self.faces):,} triangles"]
        if self.normals is not None and len(self.vertices):
            parts.append("normals")
        parts.extend(self._attributes)
        if self.unit:
            parts.append(f"in {self.unit}s")
        return f"<isobrick.Mesh: {', '.join(parts)}>"

    def save(
        self, path, *, force=False, quantize=False, compress=False, levels=None, sharded=False,
        colour_by=None, colour_map=None, progress=None,
    ):
        """Writes a mesh file.

        Parameters
        ----------
        path : str or path
            The extension is the format: .ply, .stl, .obj, .glb, .vtp, .pvtp, or .neuroglancer and
            .3dtiles, folders of levels of detail. `attributes` need .ply, .glb, .vtp or .pvtp.
        force : bool
            Replaces a file that exists; otherwise that is a UsageError.
        quantize : bool
            GLB only: 16 bits a coordinate.
        compress : bool
            GLB and 3D Tiles: compressed without loss (EXT_meshopt_compression).
        levels : int, optional
            neuroglancer and 3D Tiles only: levels of detail at most; by default until one part has
            the whole mesh.
        sharded : bool
            neuroglancer only: few large files.
        colour_by : str or (str, float, float), optional
            GLB and PLY only: colours of the vertices by one of the `attributes`, and the values with
            the first and the last colour. By default they are its smallest and its largest one.
        colour_map : "viridis", "coolwarm" or "grey", optional
            The scale of these colours: viridis, unless it is given.
        progress : function or tqdm, optional
            A function of (stage, done, total) in bytes, a tqdm bar, or the class `tqdm`.

        The file has its name once it is whole. Raises a FileError, which is an OSError, where the
        system refuses it.
        """
        options = mesh_file_options(
            force=force, quantize=quantize, compress=compress, levels=levels, sharded=sharded
        )
        attributes = [
            (attribute_name(name), self._values(name, values))
            for name, values in self._attributes.items()
        ]
        colours = colour_arguments(colour_by, colour_map, self._attributes, self._range_of)
        with reporting(progress) as report:
            self._native.save(path_text(path), attributes, colours, options, report)

    def _range_of(self, name):
        """The smallest and the largest finite value of an attribute, or None."""
        values = self._values(name, self._attributes[name])
        values = values[np.isfinite(values)]
        return (float(values.min()), float(values.max())) if values.size else None

    def _values(self, name, values):
        """The values of an attribute as the files have them."""
        values = np.ascontiguousarray(values, np.float32)
        if values.shape != (len(self.vertices),):
            raise UsageError(
                f"the attribute {name!r} must have a number for each of the "
                f"{len(self.vertices)} vertices, not the shape {values.shape}"
            )
        return values

    def filtered(
        self, *, min_component=0, largest=0, smooth=0, pass_band=0.1, simplify=None,
        max_error=None, unit="", threads=0, progress=None,
    ):
        """Another mesh, of components, smooth, simplified or in another unit, in this order.

        It has no `attributes`, whose volumes can be sampled at its own vertices.

        Parameters
        ----------
        min_component : int
            Drops components of fewer triangles.
        largest : int
            Keeps so many components, those with most triangles.
        smooth : int
            Iterations of Taubin's smoothing, which keeps the size. Borders stay where they are.
        pass_band : float
            Of the smoothing: what varies more along the surface goes, from 0, all, to 0.8, little.
        simplify : float or int, optional
            A part of the triangles, at most 1, or a number of them. The topology stays.
        max_error : float, optional
            Of the simplification: how far the surface may be from this one. Without `simplify`: as
            few triangles as this permits.
        unit : str
            Of the other mesh, such as "mm"; "" is that of this one.
        threads : int
            0 means all cores. It never changes the mesh.
        progress : function or tqdm, optional
            A function of (stage, done, total) in bytes, a tqdm bar, or the class `tqdm`.

        Works for meshes of other libraries too. Triangles share vertices by number: merge those at
        the same place first. Smooth meshes have the normals of their triangles.
        """
        options = filter_options(
            min_component=min_component, largest=largest, smooth=smooth, pass_band=pass_band,
            simplify=simplify, max_error=max_error, threads=threads,
        )
        options.unit = unit_text(unit)
        with reporting(progress) as report:
            return Mesh._of(self._native.filtered(options, report))

    def measure(self):
        """Area, enclosed volume, components, Euler number and bounds, as a `Measure`."""
        return Measure(**self._native.measure())

    def to_trimesh(self):
        """A `trimesh.Trimesh` of the same vertices and faces."""
        import trimesh

        return trimesh.Trimesh(
            self.vertices, self.faces, vertex_normals=self.normals, process=False
        )

    def to_vtk(self):
        """A `vtkPolyData` that shares vertices, normals and faces, and keeps them alive.

        Faces of more than 2³¹ vertices or corners are copied. The unit is a string in the field
        data, as in .vtp files.
        """
        from vtkmodules.util.numpy_support import numpy_to_vtk
        from vtkmodules.vtkCommonCore import vtkPoints, vtkStringArray
        from vtkmodules.vtkCommonDataModel import vtkPolyData

        data = vtkPolyData()
        points = vtkPoints()
        points.SetData(numpy_to_vtk(self.vertices))
        data.SetPoints(points)
        data.SetPolys(_vtk_cells(self.faces, len(self.vertices)))
        if self.normals is not None and len(self.vertices):
            normals = numpy_to_vtk(self.normals)
            normals.SetName("Normals")
            data.GetPointData().SetNormals(normals)
        for name, values in self._attributes.items():
            array = numpy_to_vtk(self._values(name, values))
            array.SetName(name)
            data.GetPointData().AddArray(array)
        if self.unit:
            unit = vtkStringArray()
            unit.SetName("unit")
            unit.InsertNextValue(self.unit)
            data.GetFieldData().AddArray(unit)
        return data

    def to_pyvista(self):
        """A `pyvista.PolyData` of `to_vtk()`."""
        import pyvista

        return pyvista.PolyData(self.to_vtk())

    def to_meshio(self):
        """A `meshio.Mesh` of the same vertices and faces."""
        import meshio

        data = {} if self.normals is None else {"normals": self.normals}
        for name, values in self._attributes.items():
            data[name] = self._values(name, values)
        return meshio.Mesh(self.vertices, [("triangle", self.faces)], point_data=data)


def meshes_of(natives):
    """The same dictionary of meshes of the C++ layer."""
    return {label: Mesh._of(native) for label, native in natives.items()}


def with_measure(report):
    """What a file was made of, with a `Measure` where one was requested."""
    return {**report, "measure": Measure(**report["measure"])} if "measure" in report else report


def _rebuilt(vertices, faces, normals, unit, attributes=None):
    """A mesh from a pickle."""
    return Mesh(vertices, faces, normals, unit=unit, attributes=attributes)


def _vtk_cells(faces, vertices):
    """A `vtkCellArray` of triangles, of 32 bits in the memory of the faces where they are enough."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkCellArray

    small = max(vertices, faces.size) < 2**31
    type = np.int32 if small else np.int64
    corners = faces.view(np.int32) if small else faces.astype(np.int64)
    corners = corners.reshape(-1)
    offsets = np.arange(0, 3 * len(faces) + 1, 3, dtype=type)
    cells = vtkCellArray()
    cells.SetData(numpy_to_vtk(offsets), numpy_to_vtk(corners))
    # The cells hold arrays of their own on the same memory.
    cells.GetOffsetsArray()._numpy_reference = offsets
    cells.GetConnectivityArray()._numpy_reference = corners
    return cells
