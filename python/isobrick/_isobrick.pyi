"""The bindings in C++. The package isobrick checks arguments and is what programs use."""

from typing import Any, Callable, Optional

import numpy as np
from numpy.typing import NDArray

Zyx = tuple[int, int, int]
Xyz = tuple[float, float, float]
Box = tuple[Zyx, Zyx]
Report = Optional[Callable[[str, int, int], object]]

__version__: str

class Transform:
    spacing: Xyz
    origin: Xyz
    direction: Any
    unit: str

class Inside:
    above: Inside
    below: Inside

class Topology:
    consistent: Topology
    trilinear: Topology

class Backend:
    cpu: Backend
    cuda: Backend

class ExtractOptions:
    isovalue: float
    level: int
    roi: Optional[Box]
    inside: Optional[Inside]
    normals: bool
    drop_degenerate: bool
    topology: Topology
    cap: bool
    memory: int
    memory_of_others: int
    threads: int
    backend: Backend
    gpu_memory: int
    device: int

class LabelOptions:
    background: int
    level: int
    roi: Optional[tuple[Zyx, Zyx]]
    smooth: int
    pass_band: float
    memory: int
    threads: int
    def __init__(self) -> None: ...
    def add_labels(self, first: int, last: int) -> None: ...

class MeshFilterOptions:
    min_component: int
    largest: int
    smooth: int
    pass_band: float
    simplify_ratio: float
    simplify_triangles: int
    max_error: float
    threads: int
    unit: str
    measure: bool
    def any(self) -> bool: ...

class MeshFileOptions:
    quantize: bool
    compress: bool
    levels: int
    sharded: bool
    force: bool
    threads: int
    memory: int

class VolumeRequest:
    extent: Optional[Zyx]
    type: Optional[str]
    big_endian: bool
    offset: Optional[int]
    spacing: Optional[Xyz]
    origin: Optional[Xyz]
    unit: Optional[str]
    grid: Optional[str]
    stride: Zyx
    nodata: Optional[float]
    memory: Optional[int]
    threads: int
    channel: Optional[int]
    time: Optional[int]
    def set_roi(self, lo: list[Optional[int]], hi: list[Optional[int]]) -> None: ...

class ConvertOptions:
    brick: Optional[int]
    shard: Optional[int]
    zstd_level: int
    levels: Optional[int]
    memory: int
    threads: int
    resume: bool
    force: bool
    leaf: int
    ome_04: bool
    def set_packed(self) -> None: ...
    def set_automatic(self) -> None: ...
    def set_uncompressed(self) -> None: ...
    def set_downsampling(self, name: str) -> bool: ...
    def set_index(self, name: str) -> bool: ...

class MeshSink: ...

def check_attribute_names(names: list[str]) -> None: ...

class Mesh:
    unit: str
    def __init__(
        self,
        vertices: NDArray[np.float32],
        faces: NDArray[np.uint32],
        normals: Optional[NDArray[np.float32]],
        unit: str,
    ) -> None: ...
    @property
    def vertices(self) -> NDArray[np.float32]: ...
    @property
    def normals(self) -> NDArray[np.float32]: ...
    @property
    def faces(self) -> NDArray[np.uint32]: ...
    @property
    def bounds(self) -> tuple[Xyz, Xyz]: ...
    def write_to(self, sink: MeshSink, report: Report) -> None: ...
    def filtered(self, options: MeshFilterOptions, report: Report) -> Mesh: ...
    def measure(self) -> dict[str, Any]: ...
    def save(
        self,
        path: str,
        attributes: list[tuple[str, NDArray[np.float32]]],
        colours: Optional[tuple[str, float, float, str]],
        options: MeshFileOptions,
        report: Report,
    ) -> None: ...

class DeviceMesh:
    @property
    def device(self) -> int: ...
    @property
    def stream(self) -> int: ...
    def rows(self, name: str) -> tuple[int, int]: ...
    def dlpack(self, name: str, stream: Optional[int]) -> Any: ...
    def download(self) -> Mesh: ...

class DeviceExtractor:
    @staticmethod
    def of_pointer(
        pointer: int,
        shape: Zyx,
        strides: Optional[Zyx],
        kind: str,
        bytes: int,
        transform: Transform,
        stream: int,
    ) -> DeviceExtractor: ...
    @staticmethod
    def of_capsule(capsule: Any, transform: Transform, stream: int) -> DeviceExtractor: ...
    @staticmethod
    def of_volume(
        volume: Store, options: ExtractOptions, stream: int, report: Report
    ) -> DeviceExtractor: ...
    def extract(self, options: ExtractOptions) -> DeviceMesh: ...
    @property
    def shape(self) -> Zyx: ...
    @property
    def dtype(self) -> str: ...

def extract_to_device(
    volume: Store, options: ExtractOptions, stream: int, report: Report
) -> DeviceMesh: ...

class ArrayExtractor:
    @staticmethod
    def of_array(
        samples: np.ndarray,
        transform: Transform,
        nodata: Optional[float],
        mask: Optional[np.ndarray],
    ) -> ArrayExtractor: ...
    @staticmethod
    def of_function(
        read: Callable[[Zyx, Zyx], np.ndarray],
        extent: Zyx,
        type: str,
        transform: Transform,
        nodata: Optional[float],
        mask: Optional[np.ndarray],
    ) -> ArrayExtractor: ...
    def extract(
        self, options: ExtractOptions, filters: MeshFilterOptions, report: Report
    ) -> Mesh: ...
    def extract_to(self, options: ExtractOptions, sink: MeshSink, report: Report) -> None: ...
    def extract_labels(self, options: LabelOptions, report: Report) -> dict[int, Mesh]: ...
    def surface_bounds(self, options: ExtractOptions) -> tuple[Xyz, Xyz]: ...
    def save(
        self,
        options: ExtractOptions,
        filters: MeshFilterOptions,
        path: str,
        file: MeshFileOptions,
        report: Report,
    ) -> dict[str, Any]: ...
    def isovalues(self, text: str, threads: int, report: Report) -> list[float]: ...
    def suggested_isovalue(
        self, threads: int, report: Report
    ) -> Optional[tuple[float, str]]: ...
    def histogram(self, bins: int, threads: int, report: Report) -> dict[str, Any]: ...
    @property
    def range(self) -> Optional[tuple[float, float]]: ...

class Store:
    @property
    def info(self) -> dict[str, Any]: ...
    @property
    def notes(self) -> list[str]: ...
    @property
    def range(self) -> Optional[tuple[float, float]]: ...
    def extract(
        self, options: ExtractOptions, filters: MeshFilterOptions, report: Report
    ) -> Mesh: ...
    def extract_several(
        self,
        options: ExtractOptions,
        filters: MeshFilterOptions,
        isovalues: list[float],
        report: Report,
    ) -> list[Mesh]: ...
    def extract_to(self, options: ExtractOptions, sink: MeshSink, report: Report) -> None: ...
    def extract_labels(self, options: LabelOptions, report: Report) -> dict[int, Mesh]: ...
    def sample(
        self, points: np.ndarray, unit: str, memory: int, threads: int
    ) -> np.ndarray: ...
    def surface_bounds(self, options: ExtractOptions) -> tuple[Xyz, Xyz]: ...
    def save_mesh(
        self,
        options: ExtractOptions,
        filters: MeshFilterOptions,
        path: str,
        file: MeshFileOptions,
        attributes: list[tuple[str, Store]],
        colours: Optional[tuple[str, float, float, str]],
        report: Report,
    ) -> dict[str, Any]: ...
    def estimate(self, options: ExtractOptions) -> dict[str, Any]: ...
    def read(self, level: int, box: Box, threads: int) -> np.ndarray: ...
    def histogram(self, bins: int, report: Report) -> dict[str, Any]: ...
    def isovalues(self, text: str, report: Report) -> list[float]: ...
    def suggested_isovalue(self, report: Report) -> Optional[tuple[float, str]]: ...
    def export(
        self,
        path: str,
        format: str,
        part: ExtractOptions,
        isovalue: Optional[float],
        half_band: int,
        force: bool,
        report: Report,
    ) -> None: ...

def open(
    path: str,
    request: VolumeRequest,
    cache: str,
    cache_limit: int,
    memory: int,
    threads: int,
    report: Report,
) -> Store: ...
def default_cache_folder() -> str: ...
def unit_name(unit: str) -> str: ...
def unit_names() -> str: ...
def unit_ratio(unit: str, other: str) -> float: ...
def convert_file(
    path: str, out: str, request: VolumeRequest, options: ConvertOptions, report: Report
) -> dict[str, Any]: ...
def convert_array(
    array: np.ndarray,
    transform: Transform,
    nodata: Optional[float],
    mask: Optional[np.ndarray],
    out: str,
    options: ConvertOptions,
    report: Report,
) -> dict[str, Any]: ...
def convert_function(
    read: Callable[[Zyx, Zyx], np.ndarray],
    extent: Zyx,
    type: str,
    memory: int,
    transform: Transform,
    nodata: Optional[float],
    mask: Optional[np.ndarray],
    out: str,
    options: ConvertOptions,
    report: Report,
) -> dict[str, Any]: ...
def recode(
    path: str, out: str, options: ConvertOptions, report: Report
) -> dict[str, Any]: ...
def extract_piece(
    volume: Store,
    options: ExtractOptions,
    number: int,
    count: int,
    path: str,
    force: bool,
    report: Report,
) -> dict[str, Any]: ...
def merge_mesh(
    pieces: list[str], filters: MeshFilterOptions, memory: int, report: Report
) -> Mesh: ...
def merge_to_file(
    pieces: list[str],
    filters: MeshFilterOptions,
    path: str,
    file: MeshFileOptions,
    report: Report,
) -> dict[str, Any]: ...
def extract_label_piece(
    volume: Store,
    options: LabelOptions,
    number: int,
    count: int,
    path: str,
    force: bool,
    report: Report,
) -> dict[str, Any]: ...
def merge_labels(
    pieces: list[str], memory: int, threads: int, report: Report
) -> dict[int, Mesh]: ...
def index(
    path: str,
    kind: str,
    leaf: int,
    request: VolumeRequest,
    resume: bool,
    force: bool,
    report: Report,
) -> dict[str, Any]: ...
def verify(path: str, request: VolumeRequest, report: Report) -> dict[str, Any]: ...
def describe(path: str, request: VolumeRequest) -> dict[str, Any]: ...
def synth_array(
    kind: str, shape: Zyx, dtype: str, seed: int, frequency: Optional[float], noise: float
) -> np.ndarray: ...
def synth_store(
    out: str,
    kind: str,
    shape: Zyx,
    dtype: str,
    seed: int,
    frequency: Optional[float],
    noise: float,
    options: ConvertOptions,
    report: Report,
) -> dict[str, Any]: ...
def vertex_ranges(mesh: Mesh, samples: np.ndarray) -> NDArray[np.float32]: ...
def keep_cells(mesh: Mesh, mask: np.ndarray) -> None: ...
