import numpy as np
import pytest

from hierarchy import clean
from hierarchy.clean import clean_faces, clean_points, counted, has_area, place
from hierarchy.part import UnreadableFile

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float64)


def test_sentences():
    assert counted("dropped", 1, "face", "with indices out of range") == "dropped 1 face with indices out of range"
    assert counted("dropped", 2, "vertex", "far away") == "dropped 2 vertices far away"
    assert counted("dropped", 3, "duplicate point") == "dropped 3 duplicate points"


def test_bad_faces_and_vertices_are_dropped_and_counted():
    positions = np.concatenate([SQUARE, [[np.nan, 0, 0], [0, np.inf, 0], [0, 0, 1e39], [5, 5, 5]]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 1, 4], [5, 1, 2], [6, 0, 1], [0, 1, 99], [-1, 0, 1]])
    warnings = []
    kept_positions, kept_faces, kept = clean_faces(positions, faces, 3, warnings)
    np.testing.assert_array_equal(kept_positions[kept_faces], SQUARE[[[0, 1, 2], [0, 2, 3]]])
    # Vertex 7 is good, but no face has it: it goes without a word.
    assert kept.tolist() == [0, 1, 2, 3]
    assert warnings == [
        "dropped 5 faces with indices out of range",
        "dropped 3 vertices whose positions are not finite",
        "dropped 3 faces at positions that are not finite",
    ]


def test_a_clean_mesh_stays_as_it_is():
    warnings = []
    positions, faces, kept = clean_faces(SQUARE, np.array([[0, 1, 2], [0, 2, 3]]), 0, warnings)
    assert positions is SQUARE
    assert faces.dtype == np.int32
    assert kept.tolist() == [0, 1, 2, 3]
    assert warnings == []


def test_nothing_left():
    with pytest.raises(UnreadableFile, match="nothing to draw"):
        clean_faces(SQUARE, np.array([[0, 1, 9]]), 0, [])
    for points in (np.empty((0, 3)), np.full((4, 3), np.nan)):
        with pytest.raises(UnreadableFile, match="nothing to draw"):
            clean_points(points, [])


def test_points_at_one_place_and_not_finite():
    warnings = []
    points = np.concatenate([SQUARE, SQUARE[:2], [[np.nan, 0, 0]], SQUARE[:1] + np.array([1e-12, 0, 0])])
    origin, scale, relative, kept = clean_points(points, warnings)
    np.testing.assert_allclose(scale * relative + origin, SQUARE)
    assert kept.tolist() == [0, 1, 2, 3]
    assert warnings == ["dropped 1 point whose positions are not finite", "dropped 3 duplicate points"]


def test_georeferenced_coordinates_keep_their_millimetres():
    points = SQUARE * 0.001 + [4.5e6, 5.5e6, 1e3]
    origin, scale, relative = place(points)
    np.testing.assert_allclose(scale * relative.astype(float) + origin, points, rtol=0, atol=2e-9)
    assert len(clean_points(points, [])[3]) == 4


@pytest.mark.parametrize("scale", [1e-20, 1.0, 1e20])
def test_area_at_any_scale(scale):
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0], [0.5, 1e-5, 0], [0, 0, 0]]
    positions = (np.array(corners) * scale).astype(np.float32)
    faces = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4], [0, 5, 1], [0, 0, 1]], np.int32)
    assert has_area(positions, faces).tolist() == [True, False, True, False, False]


def test_models_too_large_to_count_are_refused(monkeypatch):
    monkeypatch.setattr(clean, "MOST_FACES", 1)
    monkeypatch.setattr(clean, "MOST_POINTS", 2)
    with pytest.raises(UnreadableFile, match="too large: 2 faces"):
        clean_faces(np.zeros((3, 3)), np.array([[0, 1, 2], [0, 2, 1]]), 0, [])
    with pytest.raises(UnreadableFile, match="too large: 3 points"):
        clean_points(np.zeros((3, 3)), [])
