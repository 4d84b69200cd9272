"""Pictures of surfaces."""

import os

import numpy as np

from . import _isobrick
from ._arguments import check_names, integers_of, is_list, number, numbers, path_text
from ._device import DeviceMesh
from ._errors import Error, UsageError
from ._extract import Extractor
from ._mesh import Mesh
from ._open import open, volume_request
from ._progress import reporting
from ._samples import ARRAY_NAMES
from ._volume import Volume

_MESH_FILES = (".ply", ".stl", ".obj", ".glb", ".vtp", ".pvtp")
_FAR = 1e30  # beyond every mesh, and no infinity that would make NaN


def _module():
    """The module that draws."""
    try:
        from . import _render
    except ImportError as error:
        if error.name == f"{__package__}._render":
            why = (
                "this package was built without it; build it where libepoxy, GLM, GLFW, Dear "
                "ImGui, stb and the font DejaVu Sans are installed (ISOBRICK_VIEWER)"
            )
        else:
            why = str(error)
        raise Error(f"pictures need OpenGL: {why}") from None
    return _render


class Picture:
    """A picture in memory, which a notebook shows.

    Attributes
    ----------
    array : (height, width, 3) uint8
        sRGB, rows from the top. `numpy.asarray(picture)` is the same array.
    renderer : str
        What has drawn it, such as "llvmpipe (LLVM 15.0.6, 256 bits)".
    """

    def __init__(self, array, renderer=""):
        self.array = array
        self.renderer = renderer

    @property
    def size(self):
        """Pixels: (width, height)."""
        return self.array.shape[1], self.array.shape[0]

    def __array__(self, dtype=None, copy=None):
        if dtype is not None and np.dtype(dtype) != self.array.dtype:
            return self.array.astype(dtype)
        return self.array.copy() if copy else self.array

    def __repr__(self):
        width, height = self.size
        return f"<isobrick.Picture: {width}×{height} pixels>"

    def _repr_png_(self):
        return _module().encode_png(self.array)

    def save(self, path, *, force=False):
        """Writes a PNG file. `force` replaces a file that exists."""
        path = path_text(path)
        if not path.lower().endswith(".png"):
            raise UsageError(f"{path!r} is no picture that can be written: name it .png")
        _module().save_png(self.array, path, bool(force))


def _colour(value):
    """Three floats in [0, 1]."""
    names = {"white": "#ffffff", "black": "#000000"}
    if isinstance(value, str):
        digits = names.get(value, value)
        try:
            if len(digits) != 7 or digits[0] != "#":
                raise ValueError
            return tuple(byte / 255 for byte in bytes.fromhex(digits[1:]))
        except ValueError:
            raise UsageError(
                f"{value!r} is no colour; it is #RRGGBB, white, black or three numbers in [0, 1]"
            ) from None
    rgb = numbers(value, 3, "a colour")
    if min(rgb) < 0 or max(rgb) > 1:
        raise UsageError(f"the parts of a colour lie in [0, 1], not {rgb}")
    return rgb


def _is_colour(value):
    return isinstance(value, str) or (
        len(value) == 3 and not any(hasattr(part, "__len__") for part in value)
    )


def _opacity(value):
    opacity = number(value, "opacity")
    if not 0 < opacity <= 1:
        raise UsageError(f"opacity must be above 0 and at most 1, not {opacity}")
    return opacity


def _styles(count, colour, opacity):
    """(number, colour or None, opacity) of each surface, in the order in which they are drawn."""
    if colour is None:
        colours = []
    else:
        colours = [_colour(colour)] if _is_colour(colour) else [_colour(one) for one in colour]
    if opacity is None:
        opacities = []
    elif hasattr(opacity, "__iter__"):
        opacities = [_opacity(one) for one in opacity]
    else:
        opacities = [_opacity(opacity)] * count
    if max(len(colours), len(opacities)) > count:
        raise UsageError(f"there are more colours or opacities than surfaces ({count})")
    colours += [None] * (count - len(colours))
    opacities += [1.0] * (count - len(opacities))
    return [(i, colours[i], opacities[i]) for i in range(count)]


def _camera_text(camera):
    """The program's text of a camera, from a text or a dictionary of its parts."""
    if isinstance(camera, str):
        return camera
    if not hasattr(camera, "items"):
        raise TypeError(f"camera must be a text or a dictionary of its parts, not {camera!r}")
    parts = []
    for name, value in camera.items():
        if value is True:
            parts.append(str(name))
        elif value is not False:
            values = value if hasattr(value, "__iter__") else [value]
            parts.append(f"{name}=" + ":".join(str(float(v)) for v in values))
    return ",".join(parts)


def _region(region):
    """Two corners from three pairs (from, to) along x, y, z; None is as far as there is."""
    try:
        pairs = [(None, None) if pair is None else tuple(pair) for pair in region]
    except TypeError:
        pairs = []
    if len(pairs) != 3 or any(len(pair) != 2 for pair in pairs):
        raise UsageError(
            f"region must be three pairs (from, to) along x, y and z, not {region!r}"
        )
    lo = [-_FAR if pair[0] is None else number(pair[0], "region") for pair in pairs]
    hi = [_FAR if pair[1] is None else number(pair[1], "region") for pair in pairs]
    if not all(a < b for a, b in zip(lo, hi)):
        raise UsageError(f"the region {region!r} is empty")
    clamped = [[min(max(v, -_FAR), _FAR) for v in corner] for corner in (lo, hi)]
    return tuple(clamped[0]), tuple(clamped[1])


def _planes(clip):
    if clip is None:
        return []
    planes = list(clip)
    if planes and not hasattr(planes[0], "__iter__"):
        planes = [planes]
    return [numbers(plane, 4, "clip") for plane in planes]


def _picture_options(
    *, size, camera, background, clip, region, edges, occlusion, box, axes, scale_bar
):
    options = _module().PictureOptions()
    width, height = integers_of(size, 2, "size")
    if not 16 <= min(width, height) <= max(width, height) <= 16384:
        raise UsageError(f"size must be two numbers of pixels, 16 to 16384, not {size!r}")
    options.width, options.height = width, height
    text = _camera_text(camera)
    if text:
        options.set_camera(text)
    if background is not None:
        both = [background] * 2 if _is_colour(background) else list(background)
        if len(both) != 2:
            raise UsageError("background must be a colour, or one at the top and one at the bottom")
        options.set_background(*map(_colour, both))
    options.set_planes(_planes(clip))
    if region is not None:
        options.set_region(*_region(region))
    options.edges, options.occlusion = bool(edges), bool(occlusion)
    options.box, options.axes = bool(box), bool(axes)
    options.scale_bar = bool(scale_bar)
    if isinstance(scale_bar, str) and scale_bar != "auto":
        options.scale_bar_unit = _isobrick.unit_name(scale_bar)
        if not options.scale_bar_unit:
            raise UsageError(
                f"{scale_bar!r} is no unit of length; those are {_isobrick.unit_names()}"
            )
    return options


def render(
    source, isovalue=None, *, size=(1280, 960), camera="azimuth=30,elevation=20", colour=None,
    opacity=None, background=None, clip=None, region=None, edges=False, occlusion=True, box=False,
    axes=False, scale_bar=False, level=None, roi=None, inside=None, memory=2**30, threads=0,
    progress=None, **samples,
):
    """Draws surfaces into a `Picture`, which a notebook shows.

    OpenGL draws without a window: on a GPU, else in software. A surface of a volume is drawn while
    it is extracted, so that volume and mesh may be larger than memory.

    Parameters
    ----------
    source : Mesh, Volume, Extractor, array [z, y, x], path, or a list of meshes or mesh files
        A path is a mesh file by its extension (.ply, .stl, …), else a volume as of
        `isobrick.open`.
    isovalue : float, str or a list, optional
        Of a volume or an array, as of its `extract`. None: the suggested isovalue.
    size : (width, height)
        In pixels.
    camera : str or dict
        Parts such as "azimuth=30,elevation=20,roll=0,zoom=1,fov=30,orthographic,up=0:0:1", or
        "from=X:Y:Z", or "eye=X:Y:Z,target=X:Y:Z". A dictionary has the same parts, such as
        {"azimuth": 120, "orthographic": True, "up": (0, 0, -1)}.
    colour, opacity : one, or a list with one for each surface
        A colour is "#RRGGBB", "white", "black" or three floats in [0, 1].
    background : colour, or two from top to bottom
    clip : (nx, ny, nz, d), or a list of them
        Shows only where nx·x + ny·y + nz·z >= d, in world space.
    region : three pairs (from, to) along x, y, z
        Shows only this box of world space. None, for a pair or a number: as far as there is.
    edges, occlusion : bool
        Dark lines where the surface breaks off; darkens hollows.
    box, axes : bool
        Draws the box around the surfaces; the directions of x, y and z.
    scale_bar : bool or str
        Draws a bar of a round length, in the unit of the surfaces or in this one.
    level, roi, inside, memory, threads, progress
        As of `Volume.extract`. A coarser level is faster.
    spacing, origin, direction, unit, mask, nodata
        Of an array, as of `Extractor`.

    Examples
    --------
    Two surfaces, the outer one transparent::

        picture = isobrick.render(field, [0.2, 0.4], opacity=[0.3, 1], axes=True)
        picture.save("field.png")
    """
    options = _picture_options(
        size=size, camera=camera, background=background, clip=clip, region=region, edges=edges,
        occlusion=occlusion, box=box, axes=axes, scale_bar=scale_bar,
    )
    surface = dict(level=level, roi=roi, inside=inside, memory=memory, threads=threads)
    surface = {name: value for name, value in surface.items() if value is not None}
    sources = source if isinstance(source, (list, tuple)) else [source]
    is_mesh = [isinstance(one, (Mesh, DeviceMesh)) for one in sources]
    is_file = [_is_mesh_file(one) for one in sources]
    if sources and (all(is_mesh) or all(is_file)):
        if isovalue is not None or samples:
            raise UsageError("a mesh has no isovalue and no samples")
        draw = _draw_meshes if all(is_mesh) else _draw_files
        return draw(sources, _styles(len(sources), colour, opacity), options, progress)
    if any(is_mesh) or any(is_file):
        raise TypeError("source must be meshes, or mesh files, not both and nothing else")
    source = _opened(source, samples, progress)
    isovalues = _isovalues(source, isovalue, progress)
    styles = _styles(len(isovalues), colour, opacity)
    if isinstance(source, Extractor) and source._on_device:
        surface.pop("level", None)
        meshes = source.extract(isovalues, normals=True, progress=progress, **surface)
        return _draw_meshes(meshes, styles, options, progress)
    return _draw_surfaces(source, isovalues, styles, options, surface, progress)


def _is_mesh_file(source):
    return isinstance(source, (str, os.PathLike)) and (
        os.path.splitext(path_text(source))[1].lower() in _MESH_FILES
    )


def _opened(source, samples, progress):
    """What has surfaces."""
    if isinstance(source, (str, os.PathLike)):
        check_names("render", samples, volume_request.__kwdefaults__)
        return open(source, progress=progress, **samples)
    if isinstance(source, (Volume, Extractor)):
        if samples:
            raise TypeError(f"{sorted(samples)} concern arrays and files")
        return source
    check_names("render", samples, ARRAY_NAMES)
    return Extractor(source, **samples)


def _isovalues(source, isovalue, progress):
    if isovalue is None:
        suggested = source.suggested_isovalue(progress=progress)
        if suggested is None:
            raise UsageError("all samples are equal, so that there is no surface to draw")
        return [suggested[0]]
    if isinstance(isovalue, str):
        return source.isovalues(isovalue, progress=progress)
    if not is_list(isovalue):
        return [number(isovalue, "isovalue")]
    isovalues = [source.isovalue(one, progress=progress) for one in isovalue]
    if not isovalues:
        raise UsageError("there is no isovalue")
    return isovalues


def _ordered(styles):
    """Opaque surfaces first."""
    return sorted(styles, key=lambda style: style[2] < 1)


def _finished(drawing):
    return Picture(drawing.end(), drawing.renderer)


def _draw_surfaces(source, isovalues, styles, options, surface, progress):
    requests = [source._surface(isovalue, normals=True, **surface) for isovalue in isovalues]
    native = source._native
    if len(requests) > 1:
        bounds = [native.surface_bounds(request) for request in requests]
        options.set_frame(*_union(bounds))
    drawing = _module().Drawing(options)
    with reporting(progress) as report:
        for number_of_style, colour, opacity in _ordered(styles):
            drawing.set_style(number_of_style, colour, opacity)
            native.extract_to(requests[number_of_style], drawing.sink, report)
    return _finished(drawing)


def _union(bounds):
    lo, hi = np.array(bounds).swapaxes(0, 1)
    return tuple(lo.min(0)), tuple(hi.max(0))


def _draw_meshes(meshes, styles, options, progress):
    meshes = [mesh.to_host() if isinstance(mesh, DeviceMesh) else mesh for mesh in meshes]
    natives = [mesh._native for mesh in meshes]
    # Opaque meshes come first, and the first unit is that of the picture.
    order = _ordered(styles)
    units = [natives[i].unit for i, _, _ in order if natives[i].unit]
    bounds = []
    for native in natives:
        if len(native.vertices):
            scale = _isobrick.unit_ratio(native.unit, units[0]) if native.unit else 1.0
            bounds.append(np.multiply(native.bounds, scale))
    if not bounds:
        raise UsageError("the meshes have no triangles to draw")
    options.set_frame(*_union(bounds))
    drawing = _module().Drawing(options)
    with reporting(progress) as report:
        for i, colour, opacity in order:
            drawing.set_style(i, colour, opacity)
            natives[i].write_to(drawing.sink, report)
    return _finished(drawing)


def _draw_files(paths, styles, options, progress):
    files = [(path_text(path), colour, opacity) for path, (_, colour, opacity) in zip(paths, styles)]
    for path, _, _ in files:
        if not os.path.exists(path):
            raise FileNotFoundError(2, os.strerror(2), path)
    with reporting(progress) as report:
        return Picture(*_module().draw_files(files, options, report))
