"""Arrays in the memory of a CUDA device, of the libraries that are there."""

import numpy as np
import pytest

import isobrick


def ball(shape=(50, 40, 45), dtype=np.float32):
    z, y, x = np.indices(shape)
    return (np.hypot(np.hypot(z - 20.0, y - 19.0), x - 22.0) * 5).astype(dtype)


def _torch():
    torch = pytest.importorskip("torch")
    if not torch.cuda.is_available():
        pytest.skip("no CUDA device")
    return (
        lambda array: torch.from_numpy(array.copy()).cuda(),
        lambda rows: torch.as_tensor(rows).cpu().numpy(),
        lambda rows: torch.from_dlpack(rows).cpu().numpy(),
    )


def _cupy():
    cupy = pytest.importorskip("cupy")
    try:
        cupy.cuda.runtime.getDeviceCount()
    except cupy.cuda.runtime.CUDARuntimeError:
        pytest.skip("no CUDA device")
    return (
        cupy.asarray,
        lambda rows: cupy.asnumpy(cupy.asarray(rows)),
        lambda rows: cupy.asnumpy(cupy.from_dlpack(rows)),
    )


def _numba():
    cuda = pytest.importorskip("numba.cuda")
    if not cuda.is_available():
        pytest.skip("no CUDA device")
    copy = lambda rows: cuda.as_cuda_array(rows).copy_to_host()
    return cuda.to_device, copy, copy


@pytest.fixture(params=[_torch, _cupy, _numba], ids=["torch", "cupy", "numba"])
def library(request):
    """A function that copies to the device, and two that read rows of a mesh."""
    return request.param()


def expect_same(mesh, field, isovalue, **options):
    host = isobrick.extract(field, isovalue, **options)
    back = mesh.to_host()
    assert np.array_equal(back.vertices, host.vertices)
    assert np.array_equal(back.faces, host.faces)
    assert back.unit == host.unit
    return host


@pytest.mark.parametrize("dtype", ["uint8", "int16", "int32", "float32", "float64"])
def test_meshes_are_those_of_the_host(library, dtype):
    to_device, by_interface, by_dlpack = library
    field = ball(dtype=dtype)
    extractor = isobrick.Extractor(to_device(field), spacing=(1, 2, 3), unit="mm")
    assert extractor.shape == field.shape and extractor.dtype == field.dtype
    for isovalue in (20.5, 60):
        mesh = extractor.extract(isovalue, normals=True)
        host = expect_same(mesh, field, isovalue, spacing=(1, 2, 3), unit="mm", normals=True)
        for read in (by_interface, by_dlpack):
            assert np.array_equal(read(mesh.vertices), host.vertices)
            assert np.array_equal(read(mesh.normals), host.normals)
            assert np.array_equal(read(mesh.faces).view("uint32"), host.faces)


def test_arrays_of_any_strides(library):
    to_device = library[0]
    field = ball()
    on_device = to_device(field)
    for part in (np.s_[::2, :, ::3], np.s_[3:, 4:, 1:]):
        expect_same(isobrick.extract(on_device[part], 40), field[part], 40)
    turn = getattr(on_device, "permute", getattr(on_device, "transpose", None))
    if not hasattr(on_device, "copy_to_host"):  # Numba turns no volumes
        expect_same(isobrick.extract(turn(2, 1, 0), 40), field.transpose(2, 1, 0), 40)


def test_parts_and_missing_samples(library):
    to_device = library[0]
    field = ball()
    field[10:12, 20, 20] = np.nan
    mesh = isobrick.extract(to_device(field), 40, roi=np.s_[2:30, :, 5:], inside="below")
    expect_same(mesh, field, 40, roi=np.s_[2:30, :, 5:], inside="below")


def test_rows_outlive_mesh_and_array(library):
    to_device, by_interface, _ = library
    field = ball()
    vertices = isobrick.extract(to_device(field), 40).vertices
    for _ in range(3):
        isobrick.extract(to_device(field + 50), 90)
    assert np.array_equal(by_interface(vertices), isobrick.extract(field, 40).vertices)


def test_a_surface_without_triangles(library):
    mesh = isobrick.extract(library[0](ball()), 1e6)
    assert len(mesh) == 0 and mesh.vertices.shape == (0, 3)
    assert len(mesh.to_host()) == 0


def test_a_stream_of_torch():
    torch = pytest.importorskip("torch")
    if not torch.cuda.is_available():
        pytest.skip("no CUDA device")
    field = ball((200, 200, 200))
    host = isobrick.extract(field, 70)
    source = torch.from_numpy(field).pin_memory()
    stream = torch.cuda.Stream()
    with torch.cuda.stream(stream):
        array = torch.zeros(field.shape, device="cuda")
        array.copy_(source, non_blocking=True)
        mesh = isobrick.extract(array, 70, stream=stream)
        vertices = torch.from_dlpack(mesh.vertices)
        total = vertices.double().sum()
    stream.synchronize()
    assert np.isclose(float(total), host.vertices.astype(float).sum())


def test_jax():
    jax = pytest.importorskip("jax")
    if not any(device.platform == "gpu" for device in jax.devices()):
        pytest.skip("no CUDA device")
    field = ball()
    mesh = isobrick.extract(jax.numpy.asarray(field), 40)
    host = expect_same(mesh, field, 40)
    assert np.array_equal(np.asarray(jax.numpy.from_dlpack(mesh.vertices)), host.vertices)


class Described:
    """An array that says that it is in device memory."""

    def __init__(self, array, **changes):
        self.array, self.shape, self.dtype = array, array.shape, array.dtype
        self.__cuda_array_interface__ = {
            "shape": array.shape,
            "typestr": array.dtype.str,
            "data": (array.ctypes.data, False),
            "strides": array.strides,
            "version": 3,
            **changes,
        }


def refused(error, text, array, **options):
    with pytest.raises(error, match=text) as caught:
        isobrick.extract(array, 1, **options)
    assert "\n" not in str(caught.value)


def test_what_makes_no_sense_is_refused():
    field = ball()
    refused(ValueError, "three axes", Described(field[0]))
    refused(ValueError, "byte order", Described(field, typestr=">f4"))
    refused(ValueError, "not supported", Described(field, typestr="<f2"))
    refused(ValueError, "not supported", Described(field, typestr="<c8"))
    refused(ValueError, "mask", Described(field, mask=np.ones(field.shape, bool)))
    refused(ValueError, "nodata", Described(field), nodata=3)
    refused(TypeError, "stream", Described(field), stream="first")
    refused(ValueError, "stream", field, stream=1)
    with pytest.raises(TypeError, match="copy it to the host"):
        isobrick.convert(Described(field), "unused.zarr")


def test_memory_that_makes_no_sense_is_refused():
    field = ball()
    with pytest.raises(isobrick.Error, match="CUDA") as error:
        isobrick.extract(Described(field), 1)
    if "built without" in str(error.value):
        pytest.skip("built without CUDA")
    refused(ValueError, "none, or more", Described(field, shape=(0, 4, 4)))
    refused(ValueError, "no samples", Described(field, data=(0, False)))
    refused(ValueError, "multiple", Described(field, strides=(7201, 180, 4)))
    refused(ValueError, "stride", Described(field, strides=(7200, 0, 4)))


def test_host_memory_is_no_device_memory():
    refused(isobrick.Error, "CUDA", Described(ball()))


@pytest.fixture(scope="module")
def packed(tmp_path_factory):
    path = tmp_path_factory.mktemp("packed") / "ball.zarr"
    isobrick.convert(ball((90, 80, 70)), path, compression="packed", spacing=(1, 2, 3), unit="mm")
    return isobrick.open(path)


def _needs_device(volume):
    try:
        return volume.extract_to_device(60)
    except isobrick.Error as error:
        if "no CUDA device" in str(error) or "without CUDA" in str(error):
            pytest.skip(str(error))
        raise


def test_meshes_of_volumes_stay_on_the_device(packed):
    _needs_device(packed)
    for level in (0, 1):
        host = packed.extract(60, level=level, normals=True)
        back = packed.extract_to_device(60, level=level, normals=True).to_host()
        assert np.array_equal(back.vertices, host.vertices)
        assert np.array_equal(back.normals, host.normals)
        assert np.array_equal(back.faces, host.faces)
        assert back.unit == "mm"


def test_the_device_makes_the_mesh_of_the_processor(packed):
    _needs_device(packed)
    host, device = (packed.extract(60, backend=backend) for backend in ("cpu", "cuda"))
    assert np.array_equal(host.vertices, device.vertices)
    assert np.array_equal(host.faces, device.faces)


def test_a_volume_on_the_device_has_many_surfaces(packed):
    _needs_device(packed)
    roi = np.s_[3:60, :, 5:]
    resident = packed.to_device(roi=roi)
    assert resident.shape == packed.shape and resident.dtype == packed.dtype
    for isovalue, mesh in zip((40, 60), resident.extract([40, 60])):
        host = packed.extract(isovalue, roi=roi)
        assert np.array_equal(mesh.to_host().vertices, host.vertices)
    with pytest.raises(ValueError, match="reaches beyond"):
        resident.extract(40, roi=np.s_[:, :, :])
    with pytest.raises(ValueError, match="device"):
        packed.to_device(device=99)


def test_volumes_need_a_device(packed):
    try:
        packed.to_device()
    except isobrick.Error as error:
        assert "CUDA" in str(error)
