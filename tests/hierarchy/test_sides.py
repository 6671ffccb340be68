import numpy as np
import pytest

from hierarchy.geodesic_sphere import geodesic_sphere
from hierarchy.sides import most_area_disagrees, signed_volume


@pytest.mark.parametrize("offset", [0.0, 100.0])
def test_the_volume_is_signed_and_does_not_depend_on_the_place(offset):
    positions, faces = geodesic_sphere(20)
    moved = (positions + offset).astype(np.float32)
    assert signed_volume(moved, faces) / 6 == pytest.approx(4 / 3 * np.pi, rel=0.01)
    assert signed_volume(moved, np.ascontiguousarray(faces[:, ::-1])) < 0.0


@pytest.mark.parametrize("scale", [1e-20, 1e20])
def test_the_sign_holds_at_any_scale(scale):
    positions, faces = geodesic_sphere(3)
    assert signed_volume((positions * scale).astype(np.float32), faces) > 0.0


def test_area_decides_not_the_number_of_faces():
    positions = np.array([[0, 0, 0], [9, 0, 0], [0, 9, 0], [1, 0, 1], [0, 1, 1], [0, 0, 1]], np.float32)
    # One large face that agrees with +z, two small ones that do not.
    faces = np.array([[0, 1, 2], [5, 4, 3], [5, 4, 3]], np.int32)
    normals = np.tile(np.float32([0, 0, 1]), (6, 1))
    nothing_ignored = np.zeros(6, bool)
    assert not most_area_disagrees(positions, faces, normals, nothing_ignored)
    assert most_area_disagrees(positions, faces, -normals, nothing_ignored)
    assert most_area_disagrees(positions, faces, normals, np.arange(6) < 3)
