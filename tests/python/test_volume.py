"""Volumes in stores and files."""

import functools
import gc
import http.server
import os
import pickle
import threading
import zipfile

import numpy as np
import pytest

import isobrick
from conftest import is_closed, same


@pytest.fixture
def samples():
    return isobrick.synth("gyroid", shape=(60, 50, 40), dtype="uint8")


def test_what_is_known_of_a_store(store, samples):
    volume = isobrick.open(store)
    assert volume.shape == (60, 50, 40) and volume.dtype == np.uint8
    assert volume.levels[0].shape == volume.shape and volume.levels[0].brick == (16, 16, 16)
    assert len(volume.levels) > 1 and volume.levels[1].shape == (30, 25, 20)
    assert volume.levels[1].spacing == (2, 2, 2) and volume.spacing == (1, 1, 1)
    assert volume.range == (samples.min(), samples.max())
    assert volume.path == str(store) and "60×50×40" in repr(volume)
    assert np.array_equal(volume.direction, np.eye(3)) and volume.unit == ""
    assert volume.info["is_store"] and isobrick.info(store) == volume.info


def test_the_mesh_is_that_of_the_array(store, samples):
    volume = isobrick.open(store)
    mesh = volume.extract(127.5, normals=True)
    assert len(mesh) > 1000 and same(mesh, isobrick.extract(samples, 127.5, normals=True))
    roi = np.s_[5:50, :, 10:]
    assert same(volume.extract(127.5, roi=roi), isobrick.extract(samples, 127.5, roi=roi))
    assert same(volume.extract(127.5, backend="cpu", threads=1, memory="64M"), volume.extract(127.5))
    coarse = volume.extract(127.5, level=1)
    assert 0 < len(coarse) < len(mesh)


def test_samples_are_read_as_arrays(store, samples):
    volume = isobrick.open(store)
    assert np.array_equal(volume.read(), samples)
    assert np.array_equal(volume[3:20, 7, -5:], samples[3:20, 7, -5:])
    assert np.array_equal(volume[..., 4], samples[..., 4])
    assert volume[1, 2, 3] == samples[1, 2, 3]
    assert volume.read(1).shape == volume.levels[1].shape
    assert np.array_equal(volume.read(0, np.s_[10:11]), samples[10:11])
    with pytest.raises(IndexError):
        volume[60, 0, 0]
    assert np.array_equal(volume[::2, ::-3, 1:4], samples[::2, ::-3, 1:4])
    assert volume[5:5].shape == samples[5:5].shape
    with pytest.raises(ValueError, match="no level 9"):
        volume.read(9)


def test_a_volume_is_an_array_for_numpy(store, samples):
    volume = isobrick.open(store)
    assert volume.ndim == 3 and len(volume) == 60
    assert np.array_equal(np.asarray(volume), samples)
    assert np.asarray(volume, np.float32).dtype == np.float32
    for index in (None, [1, 2], True, "a", 1.5):
        with pytest.raises(TypeError, match="indices"):
            volume[index]
    with pytest.raises(IndexError, match="ellipsis"):
        volume[..., ...]


def test_an_opened_volume_keeps_its_place_as_an_array(tmp_path, samples):
    place = dict(spacing=(1, 2, 3), origin=(4, 5, 6), unit="mm")
    isobrick.convert(samples, tmp_path / "a.zarr", **place)
    volume = isobrick.open(tmp_path / "a.zarr")
    assert same(isobrick.extract(volume, 127.5), volume.extract(127.5))
    assert isobrick.extract(volume, 127.5).unit == "millimeter"
    isobrick.convert(volume, tmp_path / "b.zarr")
    copied = isobrick.open(tmp_path / "b.zarr")
    assert copied.spacing == (1, 2, 3) and copied.origin == (4, 5, 6)
    assert copied.unit == "millimeter" and np.array_equal(copied.read(), samples)


def test_pickles_are_opened_again(image):
    path, samples = image
    volume = isobrick.open(path, time=2, channel=1)
    other = pickle.loads(pickle.dumps(volume))
    assert other.path == volume.path and np.array_equal(other.read(), samples[2, 1])
    with pytest.raises(TypeError, match="pickle"):
        pickle.dumps(isobrick.Extractor(samples[0, 0]))


@pytest.mark.parametrize(
    "arguments, what",
    [
        ({"shape": (2**70, 1, 1)}, "shape must be at most"),
        ({"dtype": "c8"}, "complex64"),
        ({"dtype": "f2"}, "float16"),
        ({"offset": -1}, "offset must be at least 0"),
        ({"channel": 2**70}, "channel must be"),
        ({"time": -1}, "time must be"),
        ({"grid": 3}, "grid must be a text"),
        ({"stride": 2**70}, "stride must be"),
        ({"stride": 0}, "stride"),
        ({"roi": np.s_[2**70 :]}, "roi must be"),
        ({"roi": np.s_[0.5:]}, "roi must be an integer"),
        ({"unit": "hours"}, "unit of length"),
        ({"unit": 3}, "unit must be a text"),
        ({"spacing": (10**400, 1, 1)}, "finite"),
        ({"colour": 3}, "open\\(\\) got an unexpected"),
    ],
)
def test_files_described_in_ways_that_make_no_sense(tmp_path, arguments, what):
    np.zeros((4, 5, 6), np.float32).tofile(tmp_path / "a.raw")
    request = {"shape": (4, 5, 6), "dtype": "f4", **arguments}
    with pytest.raises((TypeError, ValueError), match=what) as error:
        isobrick.open(tmp_path / "a.raw", cache=False, **request)
    assert "\n" not in str(error.value)


def test_numbers_that_no_machine_has(store):
    volume = isobrick.open(store)
    for arguments in ({"device": -1}, {"device": 2**40}, {"level": 2**70}, {"threads": 2**70}):
        with pytest.raises(ValueError):
            volume.extract(127.5, **arguments)
    with pytest.raises(ValueError):
        volume.histogram(2**70)


def test_isovalues_as_texts(store, samples):
    volume = isobrick.open(store)
    assert volume.isovalue("50%") == pytest.approx((int(samples.min()) + int(samples.max())) / 2)
    assert samples.min() < volume.isovalue("otsu") < samples.max()
    assert volume.isovalues("100:140:20") == [100, 120, 140]
    assert same(volume.extract("otsu"), volume.extract(volume.isovalue("otsu")))
    assert volume.suggested_isovalue()[0] == volume.isovalue("otsu")
    with pytest.raises(ValueError):
        volume.extract("otsu,p90")
    with pytest.raises(ValueError):
        volume.extract("many")
    with pytest.raises(ValueError, match="NaN"):
        volume.extract(np.nan)


def test_the_histogram_is_that_of_numpy(store, samples):
    histogram = isobrick.open(store).histogram(256)
    expected = np.bincount(samples.ravel(), minlength=256)
    first = int(histogram.first)
    assert histogram.bin_width == 1
    assert np.array_equal(histogram.counts, expected[first : first + len(histogram.counts)])
    assert len(histogram.edges) == len(histogram.counts) + 1
    assert (histogram.lo, histogram.hi) == (samples.min(), samples.max())


def test_a_surface_streams_to_a_file(store, tmp_path):
    volume = isobrick.open(store)
    report = volume.save_mesh(tmp_path / "a.ply", "otsu", normals=True)
    mesh = volume.extract("otsu", normals=True)
    assert report["faces"] == len(mesh) and report["backend"] == "cpu"
    mesh.save(tmp_path / "b.ply")
    assert (tmp_path / "a.ply").stat().st_size == (tmp_path / "b.ply").stat().st_size
    estimate = volume.estimate("otsu")
    assert estimate["faces"] == pytest.approx(len(mesh), rel=0.5)


def test_files_of_other_formats(samples, tmp_path):
    raw = tmp_path / "a.raw"
    samples.tofile(raw)
    options = {"shape": samples.shape, "dtype": "uint8", "spacing": (1, 2, 3), "unit": "mm"}
    volume = isobrick.open(raw, cache=tmp_path / "cache", **options)
    assert volume.spacing == (1, 2, 3) and volume.unit == "millimeter"
    expected = isobrick.extract(samples, 127.5, spacing=(1, 2, 3), unit="mm")
    assert same(volume.extract(127.5), expected)
    assert volume.extract(127.5).unit == "millimeter"
    assert list((tmp_path / "cache").iterdir())
    volume = isobrick.open(raw, cache=False, stride=2, **options)
    assert volume.shape == (30, 25, 20)
    part = isobrick.open(raw, cache=False, roi=np.s_[10:20, :, 5:], stride=(1, 2, 1), **options)
    assert np.array_equal(part.read(), samples[10:20, ::2, 5:])
    for wrong in ({"roi": 3}, {"roi": np.s_[::2]}, {"roi": np.s_[70:80]}, {"stride": 0}):
        with pytest.raises((TypeError, ValueError)):
            isobrick.open(raw, cache=False, **options, **wrong)
    # The store is gone with the volume; the mesh is not.
    mesh = volume.extract(127.5)
    del volume
    gc.collect()
    assert mesh.faces.max() < len(mesh.vertices)


def test_hdf5_by_its_module(samples, tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["fields/density"] = samples
    try:
        volume = isobrick.open(f"{tmp_path}/a.h5:/fields/density", cache=tmp_path / "cache")
    except isobrick.Error as error:
        assert "built without" in str(error)
        pytest.skip("built without HDF5")
    assert np.array_equal(volume.read(), samples)


def test_zarr_on_the_disk(store, tmp_path, samples):
    zarr = pytest.importorskip("zarr")
    group = zarr.open_group(str(tmp_path / "other.zarr"), mode="w")
    array = group.create_dataset("a", data=samples, chunks=(20, 20, 20))
    volume = isobrick.open(array, cache=tmp_path / "cache")
    assert same(volume.extract(127.5), isobrick.extract(samples, 127.5))
    with pytest.raises(ValueError, match="not on the disk"):
        isobrick.open(zarr.array(samples))


def test_a_store_in_a_zip(store, samples):
    zip = store.with_name("gyroid.zarr.zip")
    with zipfile.ZipFile(zip, "w", zipfile.ZIP_STORED) as archive:
        for file in store.rglob("*"):
            if file.is_file():
                archive.write(file, file.relative_to(store))
    volume = isobrick.open(zip)
    assert same(volume.extract(127.5), isobrick.extract(samples, 127.5))
    assert np.array_equal(volume.read(), samples)
    assert isobrick.info(zip)["is_store"] and isobrick.verify(zip)["whole"]


def test_what_is_no_volume(tmp_path):
    with pytest.raises(FileNotFoundError, match="none.zarr"):
        isobrick.open(tmp_path / "none.zarr")
    (tmp_path / "empty.zarr").mkdir()
    with pytest.raises(isobrick.Error):
        isobrick.open(tmp_path / "empty.zarr")
    (tmp_path / "text.raw").write_text("text")
    with pytest.raises(ValueError):
        isobrick.open(tmp_path / "text.raw", cache=False)
    with pytest.raises(TypeError):
        isobrick.open(3)


def test_damage_is_an_oserror(store):
    largest = max((p for p in store.rglob("*") if p.is_file()), key=lambda p: p.stat().st_size)
    data = bytearray(largest.read_bytes())
    data[: len(data) // 2] = bytes(len(data) // 2)
    largest.write_bytes(data)
    with pytest.raises(OSError) as error:
        isobrick.open(store).extract(127.5)
    assert isinstance(error.value, isobrick.DamageError) and str(error.value)
    assert not isobrick.verify(store)["whole"]


def test_arguments_that_make_no_sense(store):
    volume = isobrick.open(store)
    for arguments in ({"level": -1}, {"level": 7}, {"backend": "gpu"}, {"memory": 0}):
        with pytest.raises(ValueError):
            volume.extract(127.5, **arguments)
    with pytest.raises(TypeError):
        volume.extract(127.5, level="1")
    with pytest.raises(TypeError):
        isobrick.open(store, colour=3)


def test_a_surface_of_a_store_is_closed(tmp_path):
    isobrick.synth("sphere", tmp_path / "a.zarr", shape=(40, 40, 40), dtype="float32")
    assert is_closed(isobrick.open(tmp_path / "a.zarr").extract(0).faces)


@pytest.fixture
def server(store):
    """The URL of the folder that holds the store."""
    folder = os.path.dirname(store)
    handler = functools.partial(RangeHandler, directory=folder)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as running:
        threading.Thread(target=running.serve_forever, daemon=True).start()
        running.url = f"http://127.0.0.1:{running.server_address[1]}"
        yield running
        running.shutdown()


class RangeHandler(http.server.SimpleHTTPRequestHandler):
    """The server of the standard library, with ranges of bytes."""

    def do_GET(self):
        path = self.translate_path(self.path)
        if not os.path.isfile(path):
            return self.send_error(404)
        with open(path, "rb") as file:
            data = file.read()
        self.server.ranges = getattr(self.server, "ranges", 0) + 1
        first, last = (int(n) for n in self.headers["range"].split("=")[1].split("-"))
        self.send_response(206)
        part = data[first : last + 1]
        self.send_header("content-range", f"bytes {first}-{first + len(part) - 1}/{len(data)}")
        self.send_header("content-length", str(len(part)))
        self.send_header("etag", f'"{hash(data):x}"')
        self.end_headers()
        self.wfile.write(part)

    def log_message(self, *_):
        pass


def test_bytes_of_urls_are_kept(store, server, tmp_path):
    def mesh():
        server.ranges = 0
        volume = isobrick.open(
            f"{server.url}/{os.path.basename(store)}", cache=tmp_path, remote_cache="64M"
        )
        return volume.extract(100)

    first, first_requests = mesh(), server.ranges
    assert same(mesh(), first) and same(first, isobrick.open(store).extract(100))
    assert server.ranges <= 1 < first_requests
    with pytest.raises(isobrick.UsageError, match="remote_cache"):
        isobrick.open(store, remote_cache="lots")


def test_stores_behind_urls(store, server):
    url = f"{server.url}/{os.path.basename(store)}"
    remote, local = isobrick.open(url), isobrick.open(store)
    assert remote.shape == local.shape and remote.path == url
    assert np.array_equal(remote[3:9, ::2, 5], local[3:9, ::2, 5])
    assert same(remote.extract(100), local.extract(100))
    assert same(pickle.loads(pickle.dumps(remote)).extract(100), local.extract(100))
    with pytest.raises(isobrick.Error, match="nothing.zarr' is no store"):
        isobrick.open(f"{server.url}/nothing.zarr")
    with pytest.raises(isobrick.UsageError, match="nothing can be written to a URL"):
        isobrick.index(url, "octree")


def test_values_at_points(tmp_path):
    z, y, x = np.mgrid[:20, :30, :40].astype("float32")
    field = x + 2 * y - z
    path = tmp_path / "linear.zarr"
    isobrick.convert(field, path, spacing=(0.5, 1, 2), origin=(10, 0, 0), unit="mm", brick=16)
    volume = isobrick.open(path)
    points = np.random.default_rng(1).uniform((10, 0, 0), (29.5, 29, 38), (1000, 3))
    expected = (points[:, 0] - 10) / 0.5 + 2 * points[:, 1] - points[:, 2] / 2
    values = volume.sample(points)
    assert values.dtype == np.float32
    assert np.allclose(values, expected, atol=1e-3)
    assert np.array_equal(volume.sample(points, memory="1M", threads=1), values)
    assert np.allclose(volume.sample(points / 10, unit="cm"), expected, atol=1e-3)
    assert np.isnan(volume.sample([[9, 0, 0], [np.nan, 0, 0]])).all()
    mesh = volume.extract(30)
    assert np.allclose(volume.sample(mesh), 30, atol=1e-3)
    for points in ([1, 2, 3], [[1, 2]], np.zeros((2, 3, 1))):
        with pytest.raises(ValueError, match="rows"):
            volume.sample(points)
