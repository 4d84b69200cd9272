"""Fields and measures that the tests share. A file whose tests are all skipped ends with 77."""

import json

import numpy as np
import pytest

import isobrick


def ball(shape=(40, 50, 60), radius=15.0, dtype=np.float32):
    """Larger inside: radius less the distance from the middle, so that the surface is at 0."""
    z, y, x = (np.arange(n) - (n - 1) / 2 for n in shape)
    distance = np.sqrt(z[:, None, None] ** 2 + y[:, None] ** 2 + x**2)
    return (radius - distance).astype(dtype)


@pytest.fixture
def ball_and_ramp(tmp_path):
    """Stores: a ball's distances, and a ramp from 0 to 19 along x in another spacing."""
    z, y, x = np.mgrid[:30, :32, :34].astype(np.float32)
    distance = np.sqrt((x - 16) ** 2 + (y - 15) ** 2 + (z - 14) ** 2)
    isobrick.convert(distance, tmp_path / "ball.zarr", unit="mm")
    ramp = np.mgrid[:20, :20, :20][2].astype(np.float32)
    isobrick.convert(ramp, tmp_path / "ramp.zarr", spacing=(2, 2, 2), unit="mm")
    return isobrick.open(tmp_path / "ball.zarr"), isobrick.open(tmp_path / "ramp.zarr")


def signed_volume(vertices, faces):
    a, b, c = (vertices[faces[:, i]].astype(float) for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def area(vertices, faces):
    a, b, c = (vertices[faces[:, i]].astype(float) for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def is_closed(faces):
    """Whether each edge of a triangle is that of one other, the other way round."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    forward = np.sort(edges[:, 0] << 32 | edges[:, 1])
    backward = np.sort(edges[:, 1] << 32 | edges[:, 0])
    return np.array_equal(forward, backward)


def same(a, b):
    """Whether two meshes are the same, bit for bit."""
    normals = (a.normals is None) == (b.normals is None)
    if normals and a.normals is not None:
        normals = a.normals.tobytes() == b.normals.tobytes()
    return (
        normals
        and a.vertices.tobytes() == b.vertices.tobytes()
        and a.faces.tobytes() == b.faces.tobytes()
    )


def can_draw():
    """Whether there is OpenGL for pictures."""
    try:
        isobrick.render(ball(), 0, size=(16, 16))
    except isobrick.Error as error:
        return "OpenGL" not in str(error)
    return True


@pytest.fixture
def store(tmp_path):
    """A store of a gyroid of 60×50×40 samples [z, y, x]."""
    path = tmp_path / "gyroid.zarr"
    isobrick.synth("gyroid", path, shape=(60, 50, 40), dtype="uint8", brick=16)
    return path


@pytest.fixture
def image(tmp_path):
    """An OME-Zarr image of another program with 3 times, 2 channels, 8×20×24 samples; its array."""
    samples = np.random.default_rng(1).integers(0, 255, (3, 2, 8, 20, 24), np.uint8)
    path = tmp_path / "image.zarr"
    axes = [{"name": "t", "type": "time"}, {"name": "c", "type": "channel"}]
    axes += [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"]
    scale = {"type": "scale", "scale": [1, 1, 2, 0.5, 0.5]}
    datasets = [{"path": "0", "coordinateTransformations": [scale]}]
    array = {"zarr_format": 2, "shape": samples.shape, "chunks": [1, 1, 8, 20, 24], "dtype": "|u1",
             "compressor": None, "fill_value": 0, "order": "C", "filters": None,
             "dimension_separator": "/"}
    for time in range(3):
        for channel in range(2):
            chunk = path / f"0/{time}/{channel}/0/0/0"
            chunk.parent.mkdir(parents=True)
            chunk.write_bytes(samples[time, channel].tobytes())
    (path / ".zgroup").write_text(json.dumps({"zarr_format": 2}))
    (path / ".zattrs").write_text(json.dumps(
        {"multiscales": [{"version": "0.4", "axes": axes, "datasets": datasets}]}
    ))
    (path / "0/.zarray").write_text(json.dumps(array))
    return path, samples


def pytest_sessionfinish(session, exitstatus):
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if exitstatus in (0, 5) and reporter and not reporter.stats.get("passed"):
        session.exitstatus = 77
