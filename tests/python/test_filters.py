"""Filters of meshes: components, smoothing and measures."""

import numpy as np
import pytest

import isobrick

UsageError = isobrick.UsageError


def balls():
    """A large ball and eight small ones."""
    z, y, x = np.mgrid[0:1:40j, 0:1:40j, 0:1:40j]
    distance = 0.3 - np.sqrt((x - 0.5) ** 2 + (y - 0.5) ** 2 + (z - 0.5) ** 2)
    for corner in np.ndindex(2, 2, 2):
        at = 0.1 + 0.8 * np.array(corner)
        small = 0.05 - np.sqrt((x - at[0]) ** 2 + (y - at[1]) ** 2 + (z - at[2]) ** 2)
        distance = np.maximum(distance, small)
    return distance.astype(np.float32)


@pytest.fixture(scope="module")
def field():
    return balls()


SPACING = (1 / 39,) * 3


def test_a_mesh_is_measured(field):
    mesh = isobrick.extract(field, 0, spacing=SPACING, unit="mm")
    measure = mesh.measure()
    assert isinstance(measure, isobrick.Measure)
    assert measure.closed and measure.open_sides == 0
    assert measure.components == 9 and measure.euler_number == 18
    assert measure.faces == len(mesh) and measure.vertices == len(mesh.vertices)
    expected = 4 / 3 * np.pi * (0.3**3 + 8 * 0.05**3)
    assert abs(measure.volume - expected) < 0.02 * expected
    assert measure.unit == "millimeter"
    assert np.allclose(measure.bounds, [mesh.vertices.min(0), mesh.vertices.max(0)])


def test_an_open_mesh_has_no_volume(field):
    measure = isobrick.extract(field, 0, roi=np.s_[:20]).measure()
    assert not measure.closed and measure.volume is None and measure.area > 0


def test_a_mesh_without_triangles_is_measured():
    measure = isobrick.Mesh(np.zeros((0, 3)), np.zeros((0, 3), np.uint32)).measure()
    assert measure.volume == 0 and measure.bounds is None


def test_components_are_chosen(field):
    every = isobrick.extract(field, 0)
    largest = isobrick.extract(field, 0, largest=1)
    assert largest.measure().components == 1
    assert len(largest) < len(every)
    again = isobrick.extract(field, 0, min_component=len(largest), memory="64M")
    assert np.array_equal(again.vertices, largest.vertices)
    assert np.array_equal(again.faces, largest.faces)


def test_smoothing_keeps_the_faces(field):
    mesh = isobrick.extract(field, 0, normals=True)
    smooth = isobrick.extract(field, 0, normals=True, smooth=10)
    assert np.array_equal(mesh.faces, smooth.faces)
    assert not np.array_equal(mesh.vertices, smooth.vertices)
    assert np.allclose(np.linalg.norm(smooth.normals, axis=1), 1, atol=1e-5)
    wide = isobrick.extract(field, 0, smooth=10, pass_band=0.5)
    assert not np.array_equal(wide.vertices, smooth.vertices)


def test_a_list_of_isovalues_is_filtered(field):
    for mesh in isobrick.extract(field, [0, 0.01], largest=1):
        assert mesh.measure().components == 1


def test_files_are_those_of_meshes_in_memory(field, tmp_path):
    extractor = isobrick.Extractor(field)
    report = extractor.save(tmp_path / "a.ply", 0, largest=2, smooth=3, measure=True)
    mesh = extractor.extract(0, largest=2, smooth=3)
    mesh.save(tmp_path / "b.ply")
    assert (tmp_path / "a.ply").read_bytes() == (tmp_path / "b.ply").read_bytes()
    assert report["faces"] == len(mesh) and report["vertices"] == len(mesh.vertices)
    assert report["measure"] == mesh.measure()
    assert "measure" not in extractor.save(tmp_path / "c.ply", 0)


def test_volumes_are_filtered(tmp_path):
    isobrick.convert(balls(), tmp_path / "balls.zarr")
    volume = isobrick.open(tmp_path / "balls.zarr")
    mesh = volume.extract(0, largest=1, smooth=2)
    report = volume.save_mesh(tmp_path / "a.ply", 0, largest=1, smooth=2, measure=True)
    assert report["measure"] == mesh.measure() and report["faces"] == len(mesh)
    several = volume.extract([0, 0.02], largest=1)
    assert [one.measure().components for one in several] == [1, 1]
    stl = volume.save_mesh(tmp_path / "a.stl", 0, largest=1, measure=True)
    assert stl["measure"].components == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"min_component": -1}, "min_component must be at least 0"),
        ({"largest": -1}, "largest must be at least 0"),
        ({"min_component": 5, "largest": 5}, "give one of them"),
        ({"smooth": -1}, "smooth must be at least 0"),
        ({"smooth": 5, "pass_band": 0}, "pass_band must be above 0"),
        ({"smooth": 5, "pass_band": 2}, "at most 0.8"),
    ],
)
def test_what_makes_no_sense_is_refused(field, arguments, message):
    with pytest.raises(UsageError, match=message):
        isobrick.extract(field, 0, **arguments)


def test_types_are_checked(field):
    with pytest.raises(TypeError, match="largest must be an integer"):
        isobrick.extract(field, 0, largest=1.5)


def test_simplified_meshes():
    z, y, x = np.mgrid[-1:1:64j, -1:1:64j, -1:1:64j]
    field = (1 - np.sqrt(x**2 + y**2 + z**2)).astype("f4")
    whole = isobrick.extract(field, 0.3)
    tenth = isobrick.extract(field, 0.3, simplify=0.1)
    assert len(tenth.faces) == pytest.approx(0.1 * len(whole.faces), rel=0.05)
    assert tenth.measure().euler_number == 2 and tenth.measure().open_sides == 0
    assert len(isobrick.extract(field, 0.3, simplify=2000).faces) == pytest.approx(2000, rel=0.05)
    assert len(isobrick.extract(field, 0.3, max_error=0.5).faces) < len(whole.faces)
    for wrong in ({"simplify": 0}, {"simplify": 1.5}, {"simplify": -0.1}, {"max_error": 0}):
        with pytest.raises(isobrick.UsageError, match=next(iter(wrong))):
            isobrick.extract(field, 0.3, **wrong)


def test_meshes_in_memory_are_filtered(field):
    every = isobrick.extract(field, 0, spacing=SPACING, unit="mm")
    for options in ({"largest": 1}, {"smooth": 5}, {"simplify": 0.2}, {"max_error": 0.002}):
        expected = isobrick.extract(field, 0, spacing=SPACING, unit="mm", **options)
        mesh = every.filtered(**options)
        assert np.array_equal(mesh.vertices, expected.vertices), options
        assert np.array_equal(mesh.faces, expected.faces), options
        assert np.array_equal(mesh.normals, expected.normals), options
        assert mesh.unit == "millimeter"
    assert len(every.filtered(simplify=500)) in (499, 500)
    metres = every.filtered(unit="m")
    assert metres.unit == "meter"
    assert np.allclose(metres.vertices * 1000, every.vertices)
    assert np.array_equal(every.filtered().vertices, every.vertices)


def test_meshes_of_others_are_filtered():
    # A strip that is folded back on itself, twice the same triangle, one of two vertices, and a
    # vertex that is no place.
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [2, 0, 0], [2, 1, 0], [np.nan, 0, 0]]
    faces = [[0, 1, 2], [1, 3, 2], [1, 4, 3], [4, 5, 3], [0, 1, 2], [2, 1, 0], [4, 4, 5], [5, 4, 6]]
    mesh = isobrick.Mesh(np.array(vertices), np.array(faces))
    for options in ({"simplify": 0.1}, {"max_error": 5.0}, {"smooth": 3}, {"largest": 1}):
        assert len(mesh.filtered(**options)) <= len(mesh)
    random = np.random.default_rng(1)
    soup = isobrick.Mesh(random.random((50, 3)), random.integers(0, 50, (400, 3)))
    assert len(soup.filtered(simplify=0.1, smooth=2)) <= 400


def test_filters_of_meshes_refuse_what_makes_no_sense(field):
    mesh = isobrick.extract(field, 0)
    for options in ({"simplify": 0}, {"simplify": 1.5}, {"largest": -1}, {"max_error": 0},
                    {"unit": "furlong"}, {"largest": 1, "min_component": 2}):
        with pytest.raises(UsageError):
            mesh.filtered(**options)
    with pytest.raises(UsageError, match="unit"):
        mesh.filtered(unit="mm")  # of a mesh that has none
