import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Optional, Union, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

__version__: str

_Path = Union[str, os.PathLike[str]]
_Roi = Union[slice, tuple[slice, ...], None]
_Bytes = Union[int, str]
_Progress = Union[Callable[[str, int, int], object], Any, None]
_Inside = Literal["above", "below"]
_Topology = Literal["consistent", "trilinear"]
_Backend = Literal["auto", "cpu", "cuda"]
_ColourBy = Union[str, tuple[str, float, float], None]
_ColourMap = Literal["viridis", "coolwarm", "grey"]
_Rotation = Union[Sequence[float], Sequence[Sequence[float]], NDArray[np.floating[Any]], None]
_Numbers = Optional[Sequence[float]]
_Isovalue = Union[str, float]
_Isovalues = Union[Sequence[_Isovalue], NDArray[Any]]
_Colour = Union[str, Sequence[float]]

class Error(RuntimeError): ...
class UsageError(Error, ValueError): ...
class DamageError(Error, OSError): ...
class FileError(Error, OSError): ...

@dataclass(frozen=True)
class Measure:
    vertices: int
    faces: int
    area: float
    volume: Optional[float]
    open_sides: int
    components: int
    euler_number: int
    bounds: Optional[tuple[tuple[float, float, float], tuple[float, float, float]]]
    unit: str
    @property
    def closed(self) -> bool: ...

class Mesh:
    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        normals: Optional[ArrayLike] = None,
        *,
        unit: str = "",
        attributes: Optional[Mapping[str, ArrayLike]] = None,
    ) -> None: ...
    @property
    def vertices(self) -> NDArray[np.float32]: ...
    @property
    def normals(self) -> Optional[NDArray[np.float32]]: ...
    @property
    def faces(self) -> NDArray[np.uint32]: ...
    @property
    def unit(self) -> str: ...
    @property
    def attributes(self) -> dict[str, NDArray[Any]]: ...
    def __len__(self) -> int: ...
    def save(
        self,
        path: _Path,
        *,
        force: bool = False,
        quantize: bool = False,
        compress: bool = False,
        levels: Optional[int] = None,
        sharded: bool = False,
        colour_by: _ColourBy = None,
        colour_map: Optional[_ColourMap] = None,
        progress: _Progress = None,
    ) -> None: ...
    def filtered(
        self,
        *,
        min_component: int = 0,
        largest: int = 0,
        smooth: int = 0,
        pass_band: float = 0.1,
        simplify: Union[int, float, None] = None,
        max_error: Optional[float] = None,
        unit: str = "",
        threads: int = 0,
        progress: _Progress = None,
    ) -> Mesh: ...
    def measure(self) -> Measure: ...
    def to_trimesh(self) -> Any: ...
    def to_vtk(self) -> Any: ...
    def to_pyvista(self) -> Any: ...
    def to_meshio(self) -> Any: ...

class DeviceRows:
    shape: tuple[int, int]
    dtype: np.dtype[Any]
    def __len__(self) -> int: ...
    @property
    def __cuda_array_interface__(self) -> dict[str, Any]: ...
    def __dlpack_device__(self) -> tuple[int, int]: ...
    def __dlpack__(
        self,
        *,
        stream: Optional[int] = None,
        max_version: Optional[tuple[int, int]] = None,
        dl_device: Optional[tuple[int, int]] = None,
        copy: Optional[bool] = None,
    ) -> Any: ...

class DeviceMesh:
    @property
    def vertices(self) -> DeviceRows: ...
    @property
    def normals(self) -> Optional[DeviceRows]: ...
    @property
    def faces(self) -> DeviceRows: ...
    @property
    def device(self) -> int: ...
    def __len__(self) -> int: ...
    def to_host(self) -> Mesh: ...

class DeviceVolume:
    shape: tuple[int, int, int]
    dtype: np.dtype[Any]
    @overload
    def extract(
        self,
        isovalue: _Isovalue,
        *,
        roi: _Roi = None,
        normals: bool = False,
        inside: Optional[_Inside] = None,
        progress: _Progress = None,
    ) -> DeviceMesh: ...
    @overload
    def extract(
        self,
        isovalue: _Isovalues,
        *,
        roi: _Roi = None,
        normals: bool = False,
        inside: Optional[_Inside] = None,
        progress: _Progress = None,
    ) -> list[DeviceMesh]: ...

class Extractor:
    def __init__(
        self,
        array: Any,
        *,
        spacing: _Numbers = None,
        origin: _Numbers = None,
        direction: _Rotation = None,
        unit: Optional[str] = None,
        mask: Optional[ArrayLike] = None,
        nodata: Optional[float] = None,
        stream: Any = None,
    ) -> None: ...
    @property
    def shape(self) -> tuple[int, int, int]: ...
    @property
    def dtype(self) -> np.dtype[Any]: ...
    @property
    def range(self) -> Optional[tuple[float, float]]: ...
    def isovalue(
        self,
        text: _Isovalue,
        *,
        memory: _Bytes = ...,
        threads: int = 0,
        progress: _Progress = None,
    ) -> float: ...
    def isovalues(
        self,
        text: _Isovalue,
        *,
        memory: _Bytes = ...,
        threads: int = 0,
        progress: _Progress = None,
    ) -> list[float]: ...
    def suggested_isovalue(
        self, *, memory: _Bytes = ..., threads: int = 0, progress: _Progress = None
    ) -> Optional[tuple[float, str]]: ...
    def histogram(
        self,
        bins: int = 64,
        *,
        memory: _Bytes = ...,
        threads: int = 0,
        progress: _Progress = None,
    ) -> Histogram: ...
    @overload
    def extract(
        self,
        isovalue: _Isovalue,
        *,
        roi: _Roi = None,
        normals: bool = False,
        inside: _Inside = "above",
        drop_degenerate: bool = False,
        topology: _Topology = "consistent",
        cap: bool = False,
        min_component: int = 0,
        largest: int = 0,
        smooth: int = 0,
        pass_band: float = 0.1,
        simplify: Union[int, float, None] = None,
        max_error: Optional[float] = None,
        memory: _Bytes = ...,
        threads: int = 0,
        progress: _Progress = None,
    ) -> Union[Mesh, DeviceMesh]: ...
    @overload
    def extract(
        self,
        isovalue: _Isovalues,
        *,
        roi: _Roi = None,
        normals: bool = False,
        inside: _Inside = "above",
        drop_degenerate: bool = False,
        topology: _Topology = "consistent",
        cap: bool = False,
        min_component: int = 0,
        largest: int = 0,
        smooth: int = 0,
        pass_band: float = 0.1,
        simplify: Union[int, float, None] = None,
        max_error: Optional[float] = None,
        memory: _Bytes = ...,
        threads: int = 0,
        progress: _Progress = None,
    ) -> list[Union[Mesh, DeviceMesh]]: ...
    def save(
        self,
        path: _Path,
        isovalue: _Isovalue,
        *,
        roi: _Roi = None,
        normals: bool = False,
        inside: _Inside = "above",
        drop_degenerate: bool = False,
        topology: _Topology = "consistent",
        cap: bool = False,
        min_component: int = 0,
        largest: int = 0,
        smooth: int = 0,
        pass_band: float = 0.1,
        simplify: Union[int, float, None] = None,
        max_error: Optional[float] = None,
        measure: bool = False,
        memory: _Bytes = ...,
        threads: int = 0,
        progress: _Progress = None,
        force: bool = False,
        quantize: bool = False,
        compress: bool = False,
    ) -> dict[str, Any]: ...

def extract_labels(
    array: Any,
    labels: Union[int, Sequence[int], ArrayLike, None] = None,
    *,
    spacing: _Numbers = None,
    origin: _Numbers = None,
    direction: _Rotation = None,
    unit: Optional[str] = None,
    mask: Optional[ArrayLike] = None,
    nodata: Optional[float] = None,
    roi: _Roi = None,
    background: int = 0,
    smooth: int = 0,
    pass_band: float = 0.1,
    memory: _Bytes = ...,
    threads: int = 0,
    progress: _Progress = None,
) -> dict[int, Mesh]: ...
@overload
def extract(
    array: Any,
    isovalue: _Isovalue,
    *,
    spacing: _Numbers = None,
    origin: _Numbers = None,
    direction: _Rotation = None,
    unit: Optional[str] = None,
    mask: Optional[ArrayLike] = None,
    nodata: Optional[float] = None,
    stream: Any = None,
    roi: _Roi = None,
    normals: bool = False,
    inside: _Inside = "above",
    drop_degenerate: bool = False,
    topology: _Topology = "consistent",
    cap: bool = False,
    min_component: int = 0,
    largest: int = 0,
    smooth: int = 0,
    pass_band: float = 0.1,
    simplify: Union[int, float, None] = None,
    max_error: Optional[float] = None,
    memory: _Bytes = ...,
    threads: int = 0,
    progress: _Progress = None,
) -> Union[Mesh, DeviceMesh]: ...
@overload
def extract(
    array: Any,
    isovalue: _Isovalues,
    *,
    spacing: _Numbers = None,
    origin: _Numbers = None,
    direction: _Rotation = None,
    unit: Optional[str] = None,
    mask: Optional[ArrayLike] = None,
    nodata: Optional[float] = None,
    stream: Any = None,
    roi: _Roi = None,
    normals: bool = False,
    inside: _Inside = "above",
    drop_degenerate: bool = False,
    topology: _Topology = "consistent",
    cap: bool = False,
    min_component: int = 0,
    largest: int = 0,
    smooth: int = 0,
    pass_band: float = 0.1,
    simplify: Union[int, float, None] = None,
    max_error: Optional[float] = None,
    memory: _Bytes = ...,
    threads: int = 0,
    progress: _Progress = None,
) -> list[Union[Mesh, DeviceMesh]]: ...
def marching_cubes(
    volume: np.ndarray[Any, Any],
    level: Optional[float] = None,
    *,
    spacing: Sequence[float] = ...,
    gradient_direction: Literal["descent", "ascent"] = "descent",
    step_size: int = 1,
    allow_degenerate: bool = True,
    method: Literal["lewiner", "lorensen"] = "lewiner",
    mask: Optional[ArrayLike] = None,
) -> tuple[NDArray[Any], NDArray[np.int32], NDArray[np.float32], NDArray[np.float32]]: ...
@dataclass(frozen=True)
class Level:
    shape: tuple[int, int, int]
    spacing: tuple[float, float, float]
    origin: tuple[float, float, float]
    direction: tuple[float, ...]
    unit: str
    brick: tuple[int, int, int]
    shard: tuple[int, int, int]

@dataclass(frozen=True)
class Histogram:
    counts: NDArray[np.uint64]
    first: float
    bin_width: float
    lo: float
    hi: float
    level: int
    nan: int
    infinite: int
    @property
    def edges(self) -> NDArray[np.float64]: ...

class Volume:
    @property
    def path(self) -> str: ...
    @property
    def levels(self) -> tuple[Level, ...]: ...
    @property
    def shape(self) -> tuple[int, int, int]: ...
    @property
    def ndim(self) -> int: ...
    @property
    def dtype(self) -> np.dtype[Any]: ...
    @property
    def spacing(self) -> tuple[float, float, float]: ...
    @property
    def origin(self) -> tuple[float, float, float]: ...
    @property
    def direction(self) -> NDArray[np.float64]: ...
    @property
    def unit(self) -> str: ...
    @property
    def range(self) -> Optional[tuple[float, float]]: ...
    @property
    def info(self) -> dict[str, Any]: ...
    @property
    def notes(self) -> list[str]: ...
    def isovalue(self, text: _Isovalue, *, progress: _Progress = None) -> float: ...
    def isovalues(self, text: _Isovalue, *, progress: _Progress = None) -> list[float]: ...
    def suggested_isovalue(
        self, *, progress: _Progress = None
    ) -> Optional[tuple[float, str]]: ...
    def histogram(self, bins: int = 64, *, progress: _Progress = None) -> Histogram: ...
    @overload
    def extract(
        self,
        isovalue: _Isovalue,
        *,
        level: int = 0,
        roi: _Roi = None,
        normals: bool = False,
        inside: Optional[_Inside] = None,
        drop_degenerate: bool = False,
        topology: _Topology = "consistent",
        cap: bool = False,
        min_component: int = 0,
        largest: int = 0,
        smooth: int = 0,
        pass_band: float = 0.1,
        simplify: Union[int, float, None] = None,
        max_error: Optional[float] = None,
        backend: _Backend = "auto",
        memory: _Bytes = ...,
        threads: int = 0,
        gpu_memory: _Bytes = 0,
        device: int = 0,
        progress: _Progress = None,
        attributes: Optional[Mapping[str, Union[Volume, _Path]]] = None,
    ) -> Mesh: ...
    @overload
    def extract(
        self,
        isovalue: _Isovalues,
        *,
        level: int = 0,
        roi: _Roi = None,
        normals: bool = False,
        inside: Optional[_Inside] = None,
        drop_degenerate: bool = False,
        topology: _Topology = "consistent",
        cap: bool = False,
        min_component: int = 0,
        largest: int = 0,
        smooth: int = 0,
        pass_band: float = 0.1,
        simplify: Union[int, float, None] = None,
        max_error: Optional[float] = None,
        backend: _Backend = "auto",
        memory: _Bytes = ...,
        threads: int = 0,
        gpu_memory: _Bytes = 0,
        device: int = 0,
        progress: _Progress = None,
        attributes: Optional[Mapping[str, Union[Volume, _Path]]] = None,
    ) -> list[Mesh]: ...
    def extract_to_device(
        self,
        isovalue: _Isovalue,
        *,
        level: int = 0,
        roi: _Roi = None,
        normals: bool = False,
        inside: Optional[_Inside] = None,
        device: int = 0,
        gpu_memory: _Bytes = 0,
        memory: _Bytes = ...,
        threads: int = 0,
        stream: Any = None,
        progress: _Progress = None,
    ) -> DeviceMesh: ...
    def to_device(
        self,
        *,
        level: int = 0,
        roi: _Roi = None,
        device: int = 0,
        gpu_memory: _Bytes = 0,
        memory: _Bytes = ...,
        threads: int = 0,
        stream: Any = None,
        progress: _Progress = None,
    ) -> DeviceVolume: ...
    def extract_labels(
        self,
        labels: Union[int, Sequence[int], ArrayLike, None] = None,
        *,
        level: int = 0,
        roi: _Roi = None,
        background: int = 0,
        smooth: int = 0,
        pass_band: float = 0.1,
        memory: _Bytes = ...,
        threads: int = 0,
        progress: _Progress = None,
    ) -> dict[int, Mesh]: ...
    def sample(
        self,
        points: Union[ArrayLike, Mesh],
        *,
        unit: Optional[str] = None,
        memory: _Bytes = ...,
        threads: int = 0,
    ) -> NDArray[np.float32]: ...
    def save_mesh(
        self,
        path: _Path,
        isovalue: _Isovalue,
        *,
        level: int = 0,
        roi: _Roi = None,
        normals: bool = False,
        inside: Optional[_Inside] = None,
        drop_degenerate: bool = False,
        topology: _Topology = "consistent",
        cap: bool = False,
        min_component: int = 0,
        largest: int = 0,
        smooth: int = 0,
        pass_band: float = 0.1,
        simplify: Union[int, float, None] = None,
        max_error: Optional[float] = None,
        measure: bool = False,
        backend: _Backend = "auto",
        memory: _Bytes = ...,
        threads: int = 0,
        gpu_memory: _Bytes = 0,
        device: int = 0,
        progress: _Progress = None,
        force: bool = False,
        quantize: bool = False,
        compress: bool = False,
        attributes: Optional[Mapping[str, Union[Volume, _Path]]] = None,
        colour_by: _ColourBy = None,
        colour_map: Optional[_ColourMap] = None,
    ) -> dict[str, Any]: ...
    def extract_piece(
        self,
        isovalue: _Isovalue,
        path: _Path,
        part: tuple[int, int],
        *,
        level: int = 0,
        roi: _Roi = None,
        normals: bool = False,
        inside: Optional[_Inside] = None,
        drop_degenerate: bool = False,
        topology: _Topology = "consistent",
        cap: bool = False,
        memory: _Bytes = ...,
        threads: int = 0,
        progress: _Progress = None,
        force: bool = False,
    ) -> dict[str, Any]: ...
    def extract_label_piece(
        self,
        path: _Path,
        part: tuple[int, int],
        labels: Union[int, Sequence[int], ArrayLike, None] = None,
        *,
        level: int = 0,
        roi: _Roi = None,
        background: int = 0,
        smooth: int = 0,
        pass_band: float = 0.1,
        memory: _Bytes = ...,
        threads: int = 0,
        progress: _Progress = None,
        force: bool = False,
    ) -> dict[str, Any]: ...
    def estimate(
        self, isovalue: _Isovalue, *, level: int = 0, roi: _Roi = None
    ) -> dict[str, Any]: ...
    def read(self, level: int = 0, roi: _Roi = None, *, threads: int = 0) -> NDArray[Any]: ...
    def __getitem__(self, index: Any) -> Any: ...
    def __len__(self) -> int: ...
    def __array__(self, dtype: Any = None, copy: Optional[bool] = None) -> NDArray[Any]: ...
    def export(
        self,
        path: _Path,
        *,
        level: int = 0,
        roi: _Roi = None,
        format: Optional[Literal["raw", "nrrd", "vdb", "zip"]] = None,
        isovalue: Optional[_Isovalue] = None,
        half_band: int = 3,
        inside: Optional[_Inside] = None,
        force: bool = False,
        memory: _Bytes = ...,
        threads: int = 0,
        progress: _Progress = None,
    ) -> None: ...

class Picture:
    array: NDArray[np.uint8]
    renderer: str
    def __init__(self, array: NDArray[np.uint8], renderer: str = "") -> None: ...
    @property
    def size(self) -> tuple[int, int]: ...
    def __array__(self, dtype: Any = None, copy: Optional[bool] = None) -> NDArray[Any]: ...
    def _repr_png_(self) -> bytes: ...
    def save(self, path: _Path, *, force: bool = False) -> None: ...

def render(
    source: Any,
    isovalue: Union[_Isovalue, _Isovalues, None] = None,
    *,
    size: tuple[int, int] = (1280, 960),
    camera: Union[str, dict[str, Any]] = "azimuth=30,elevation=20",
    colour: Union[_Colour, Sequence[_Colour], None] = None,
    opacity: Union[float, Sequence[float], None] = None,
    background: Union[_Colour, tuple[_Colour, _Colour], None] = None,
    clip: Union[Sequence[float], Sequence[Sequence[float]], None] = None,
    region: Optional[Sequence[Optional[tuple[Optional[float], Optional[float]]]]] = None,
    edges: bool = False,
    occlusion: bool = True,
    box: bool = False,
    axes: bool = False,
    scale_bar: Union[bool, str] = False,
    level: Optional[int] = None,
    roi: _Roi = None,
    inside: Optional[_Inside] = None,
    memory: _Bytes = ...,
    threads: int = 0,
    progress: _Progress = None,
    **samples: Any,
) -> Picture: ...
def open(
    source: Any,
    *,
    cache: Union[bool, _Path] = True,
    cache_limit: _Bytes = ...,
    remote_cache: Optional[_Bytes] = None,
    memory: _Bytes = ...,
    threads: int = 0,
    progress: _Progress = None,
    **request: Any,
) -> Volume: ...
def convert(
    source: Any, path: _Path, *, progress: _Progress = None, **options: Any
) -> dict[str, Any]: ...
@overload
def merge(
    pieces: Sequence[_Path],
    path: None = None,
    *,
    min_component: int = 0,
    largest: int = 0,
    smooth: int = 0,
    pass_band: float = 0.1,
    simplify: Optional[float] = None,
    max_error: Optional[float] = None,
    measure: bool = False,
    memory: _Bytes = ...,
    threads: int = 0,
    progress: _Progress = None,
    force: bool = False,
    quantize: bool = False,
    compress: bool = False,
    levels: Optional[int] = None,
    sharded: bool = False,
) -> Mesh: ...
@overload
def merge(
    pieces: Sequence[_Path],
    path: _Path,
    *,
    min_component: int = 0,
    largest: int = 0,
    smooth: int = 0,
    pass_band: float = 0.1,
    simplify: Optional[float] = None,
    max_error: Optional[float] = None,
    measure: bool = False,
    memory: _Bytes = ...,
    threads: int = 0,
    progress: _Progress = None,
    force: bool = False,
    quantize: bool = False,
    compress: bool = False,
    levels: Optional[int] = None,
    sharded: bool = False,
) -> dict[str, Any]: ...
def merge_labels(
    pieces: Sequence[_Path],
    *,
    memory: _Bytes = ...,
    threads: int = 0,
    progress: _Progress = None,
) -> dict[int, Mesh]: ...
def recode(
    source: _Path,
    path: _Path,
    compression: Union[int, Literal["packed", "auto"], None] = "auto",
    *,
    resume: bool = False,
    force: bool = False,
    memory: _Bytes = ...,
    threads: int = 0,
    progress: _Progress = None,
) -> dict[str, Any]: ...
def index(
    path: _Path,
    kind: Literal["linear", "interval", "kdtree", "quadtree", "octree", "labels"] = "octree",
    *,
    leaf: int = 16,
    channel: Optional[int] = None,
    time: Optional[int] = None,
    resume: bool = False,
    force: bool = False,
    memory: _Bytes = ...,
    threads: int = 0,
    progress: _Progress = None,
) -> dict[str, Any]: ...
def info(source: Any, **request: Any) -> dict[str, Any]: ...
def verify(
    path: _Path,
    *,
    channel: Optional[int] = None,
    time: Optional[int] = None,
    memory: _Bytes = ...,
    threads: int = 0,
    progress: _Progress = None,
) -> dict[str, Any]: ...
def export(source: Any, path: _Path, *, progress: _Progress = None, **options: Any) -> None: ...
def synth(
    kind: Literal["sphere", "gyroid", "marschner-lobb", "mixing", "cells"],
    path: Optional[_Path] = None,
    *,
    shape: Sequence[int],
    dtype: DTypeLike = "uint8",
    seed: int = 1,
    frequency: Optional[float] = None,
    noise: float = 0.01,
    progress: _Progress = None,
    **options: Any,
) -> Any: ...
