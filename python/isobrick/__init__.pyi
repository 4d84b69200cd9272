import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Optional, Union

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
_Rotation = Union[Sequence[float], Sequence[Sequence[float]], NDArray[np.floating[Any]], None]
_Numbers = Optional[Sequence[float]]

class Error(RuntimeError): ...
class UsageError(Error, ValueError): ...
class DamageError(Error, OSError): ...

class Mesh:
    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        normals: Optional[ArrayLike] = None,
        *,
        unit: str = "",
    ) -> None: ...
    @property
    def vertices(self) -> NDArray[np.float32]: ...
    @property
    def normals(self) -> Optional[NDArray[np.float32]]: ...
    @property
    def faces(self) -> NDArray[np.uint32]: ...
    @property
    def unit(self) -> str: ...
    def __len__(self) -> int: ...
    def save(self, path: _Path, *, force: bool = False, quantize: bool = False) -> None: ...
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
    def extract(
        self,
        isovalue: float,
        *,
        roi: _Roi = None,
        normals: bool = False,
        inside: _Inside = "above",
        drop_degenerate: bool = False,
        topology: _Topology = "consistent",
        memory: _Bytes = ...,
        threads: int = 0,
        progress: _Progress = None,
    ) -> Union[Mesh, DeviceMesh]: ...
    def save(
        self,
        path: _Path,
        isovalue: float,
        *,
        roi: _Roi = None,
        normals: bool = False,
        inside: _Inside = "above",
        drop_degenerate: bool = False,
        topology: _Topology = "consistent",
        memory: _Bytes = ...,
        threads: int = 0,
        progress: _Progress = None,
        force: bool = False,
        quantize: bool = False,
    ) -> dict[str, Any]: ...

def extract(
    array: Any,
    isovalue: float,
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
    memory: _Bytes = ...,
    threads: int = 0,
    progress: _Progress = None,
) -> Union[Mesh, DeviceMesh]: ...
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
    def isovalue(self, text: Union[str, float], *, progress: _Progress = None) -> float: ...
    def isovalues(self, text: Union[str, float], *, progress: _Progress = None) -> list[float]: ...
    def suggested_isovalue(
        self, *, progress: _Progress = None
    ) -> Optional[tuple[float, str]]: ...
    def histogram(self, bins: int = 64, *, progress: _Progress = None) -> Histogram: ...
    def extract(
        self,
        isovalue: Union[str, float],
        *,
        level: int = 0,
        roi: _Roi = None,
        normals: bool = False,
        inside: Optional[_Inside] = None,
        drop_degenerate: bool = False,
        topology: _Topology = "consistent",
        backend: _Backend = "auto",
        memory: _Bytes = ...,
        threads: int = 0,
        gpu_memory: _Bytes = 0,
        device: int = 0,
        progress: _Progress = None,
    ) -> Mesh: ...
    def save_mesh(
        self,
        path: _Path,
        isovalue: Union[str, float],
        *,
        level: int = 0,
        roi: _Roi = None,
        normals: bool = False,
        inside: Optional[_Inside] = None,
        drop_degenerate: bool = False,
        topology: _Topology = "consistent",
        backend: _Backend = "auto",
        memory: _Bytes = ...,
        threads: int = 0,
        gpu_memory: _Bytes = 0,
        device: int = 0,
        progress: _Progress = None,
        force: bool = False,
        quantize: bool = False,
    ) -> dict[str, Any]: ...
    def estimate(
        self, isovalue: Union[str, float], *, level: int = 0, roi: _Roi = None
    ) -> dict[str, Any]: ...
    def read(self, level: int = 0, roi: _Roi = None, *, threads: int = 0) -> NDArray[Any]: ...
    def __getitem__(self, index: Any) -> Any: ...
    def export(
        self,
        path: _Path,
        *,
        level: int = 0,
        roi: _Roi = None,
        format: Optional[Literal["raw", "nrrd", "vdb", "zip"]] = None,
        isovalue: Union[str, float, None] = None,
        half_band: int = 3,
        inside: Optional[_Inside] = None,
        force: bool = False,
        memory: _Bytes = ...,
        threads: int = 0,
        progress: _Progress = None,
    ) -> None: ...

def open(
    source: Any,
    *,
    cache: Union[bool, _Path] = True,
    cache_limit: _Bytes = ...,
    memory: _Bytes = ...,
    threads: int = 0,
    progress: _Progress = None,
    **request: Any,
) -> Volume: ...
def convert(
    source: Any, path: _Path, *, progress: _Progress = None, **options: Any
) -> dict[str, Any]: ...
def index(
    path: _Path,
    kind: Literal["linear", "interval", "kdtree", "quadtree", "octree"] = "octree",
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
    kind: Literal["sphere", "gyroid", "marschner-lobb", "mixing"],
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
