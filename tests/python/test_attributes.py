"""Vertex attributes: sampled from volumes, kept with a mesh, written to files."""

import pickle

import numpy as np
import pytest

import isobrick


def test_are_samples_at_the_vertices(ball_and_ramp, tmp_path):
    ball, ramp = ball_and_ramp
    mesh = ball.extract(9.5, attributes={"ramp": ramp, "Itself": tmp_path / "ball.zarr"})
    assert list(mesh.attributes) == ["ramp", "Itself"]
    assert "ramp" in repr(mesh)
    assert mesh.attributes["ramp"].dtype == np.float32
    np.testing.assert_allclose(mesh.attributes["ramp"], mesh.vertices[:, 0] / 2, atol=1e-4)
    np.testing.assert_allclose(mesh.attributes["Itself"], 9.5, atol=1e-4)
    plain = ball.extract(9.5)
    assert plain.attributes == {}
    assert np.array_equal(plain.faces, mesh.faces)
    several = ball.extract([5, 9.5], simplify=0.5, attributes={"ramp": ramp})
    for one in several:
        assert np.array_equal(one.attributes["ramp"], ramp.sample(one))


@pytest.mark.parametrize("extension", ["ply", "glb", "vtp"])
def test_a_file_is_that_of_the_stream(ball_and_ramp, tmp_path, extension):
    ball, ramp = ball_and_ramp
    others = {"ramp": ramp, "Itself": ball}
    mesh = ball.extract(9.5, normals=True, attributes=others)
    mesh.save(tmp_path / f"a.{extension}")
    report = ball.save_mesh(tmp_path / f"b.{extension}", 9.5, normals=True, attributes=others)
    assert report["vertices"] == len(mesh.vertices)
    written = (tmp_path / f"a.{extension}").read_bytes()
    assert written == (tmp_path / f"b.{extension}").read_bytes()
    name = b"_ITSELF" if extension == "glb" else b"Itself"
    assert name in written
    ball.extract(9.5, normals=True).save(tmp_path / f"c.{extension}")
    more = len(written) - (tmp_path / f"c.{extension}").stat().st_size
    assert 8 * len(mesh.vertices) <= more <= 8 * len(mesh.vertices) + 1000


def test_the_values_of_a_ply_are_those_of_the_mesh(ball_and_ramp, tmp_path):
    ball, ramp = ball_and_ramp
    mesh = ball.extract(9.5, attributes={"ramp": ramp})
    mesh.attributes["own"] = np.arange(len(mesh.vertices))
    mesh.attributes["ramp"][3] = np.nan
    mesh.save(tmp_path / "a.ply")
    body = (tmp_path / "a.ply").read_bytes().split(b"end_header\n", 1)[1]
    rows = np.frombuffer(body, np.float32, 5 * len(mesh.vertices)).reshape(-1, 5)
    assert np.array_equal(rows[:, :3], mesh.vertices)
    assert np.array_equal(rows[:, 3], mesh.attributes["ramp"], equal_nan=True)
    assert np.array_equal(rows[:, 4], np.arange(len(mesh.vertices)))


def test_stay_with_the_mesh(ball_and_ramp):
    ball, ramp = ball_and_ramp
    mesh = ball.extract(9.5, attributes={"ramp": ramp})
    again = pickle.loads(pickle.dumps(mesh))
    assert np.array_equal(again.attributes["ramp"], mesh.attributes["ramp"])
    assert mesh.filtered(simplify=0.5).attributes == {}
    made = isobrick.Mesh(mesh.vertices, mesh.faces, attributes={"one": np.ones(len(mesh.vertices))})
    assert made.attributes["one"].dtype == np.float32


def test_go_to_vtk(ball_and_ramp):
    pytest.importorskip("vtkmodules")
    ball, ramp = ball_and_ramp
    mesh = ball.extract(9.5, attributes={"ramp": ramp})
    array = mesh.to_vtk().GetPointData().GetArray("ramp")
    assert array.GetTuple1(7) == mesh.attributes["ramp"][7]


def test_bad_ones_are_refused(ball_and_ramp, tmp_path):
    ball, ramp = ball_and_ramp
    for name in ("x", "2p", "a b", ""):
        with pytest.raises(isobrick.UsageError, match="no name of an attribute"):
            ball.extract(9.5, attributes={name: ramp})
    with pytest.raises(isobrick.UsageError, match="given twice"):
        ball.save_mesh(tmp_path / "a.ply", 9.5, attributes={"p": ramp, "P": ramp})
    with pytest.raises(TypeError, match="name"):
        ball.extract(9.5, attributes={1: ramp})
    with pytest.raises(OSError):
        ball.extract(9.5, attributes={"p": tmp_path / "none.zarr"})
    mesh = ball.extract(9.5, attributes={"ramp": ramp})
    with pytest.raises(isobrick.UsageError, match="STL cannot hold attributes"):
        mesh.save(tmp_path / "a.stl")
    mesh.attributes["ramp"] = mesh.attributes["ramp"][1:]
    with pytest.raises(isobrick.UsageError, match="'ramp'.*vertices"):
        mesh.save(tmp_path / "a.ply")
    mesh.attributes.clear()
    mesh.attributes["nx"] = np.zeros(len(mesh.vertices))
    with pytest.raises(isobrick.UsageError, match="'nx'"):
        mesh.save(tmp_path / "a.ply")
    assert not list(tmp_path.glob("a.*"))
