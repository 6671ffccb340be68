import json
import sys
import zipfile

import numpy as np
import pytest
import trimesh
from PIL import Image

from hierarchy.load import load_model
from hierarchy.model import Mesh, ModelError, PointCloud, in_file_space
from hierarchy.trimesh_files import _placed, mesh_part, read_with_trimesh


def scene_with(transform, mesh):
    scene = trimesh.Scene()
    scene.add_geometry(mesh, transform=np.eye(4))
    scene.add_geometry(mesh, transform=transform)
    return scene


def box():
    return trimesh.creation.box(extents=(1, 2, 3))


def write_gltf(folder, mesh):
    # Mesh.export leaves the files that it writes open.
    for name, data in trimesh.exchange.gltf.export_gltf(trimesh.Scene(mesh)).items():
        (folder / name).write_bytes(data)
    return folder / "model.gltf"


@pytest.mark.parametrize("suffix", ["off", "glb", "3mf", "dae", "stl", "obj", "ply"])
def test_every_kind_gives_the_same_box(tmp_path, suffix):
    path = tmp_path / f"box.{suffix}"
    box().export(path)
    mesh = load_model(path)
    assert isinstance(mesh, Mesh)
    assert mesh.name == path.name
    assert mesh.closed
    assert len(mesh.faces) == 12
    np.testing.assert_allclose(mesh.scale * np.ptp(mesh.positions, axis=0), [1, 2, 3], atol=1e-6)
    if suffix != "dae":
        # A box is all creases, where the file says nothing else (COLLADA is written with normals).
        np.testing.assert_allclose(np.abs(mesh.normals).max(axis=1), 1.0, atol=1e-6)


def test_files_beside_the_model_are_read(tmp_path):
    mesh = load_model(write_gltf(tmp_path, box()))
    assert mesh.closed
    assert mesh.warnings == ()


def test_transforms_are_applied(tmp_path):
    transform = trimesh.transformations.translation_matrix((10, 0, 0)) @ np.diag([2.0, 2, 2, 1])
    scene_with(transform, box()).export(tmp_path / "two.glb")
    mesh = load_model(tmp_path / "two.glb")
    assert len(mesh.faces) == 24
    np.testing.assert_allclose(mesh.origin, [5.25, 0, 0], atol=1e-6)
    np.testing.assert_allclose(mesh.scale * np.ptp(mesh.positions, axis=0), [11.5, 4, 6], atol=1e-5)


def test_a_mirror_turns_the_faces_round_again(tmp_path):
    sphere = trimesh.creation.icosphere(2)
    assert sphere.vertex_normals is not None  # now they are exported, too
    scene_with(np.diag([-1.0, 3, 1, 1]) @ trimesh.transformations.translation_matrix((5, 0, 0)), sphere).export(
        tmp_path / "two.glb", include_normals=True
    )
    parts = read_with_trimesh(tmp_path / "two.glb", "glb", [])
    assert len(parts) == 2
    for part in parts:
        centre = part.positions.mean(axis=0)
        corners = part.positions[part.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (np.einsum("ij,ij->i", normals, corners.mean(axis=1) - centre) > 0).all()
        assert (np.einsum("ij,ij->i", part.normals, part.positions - centre) > 0).all()
        # On an ellipsoid normals scale with the inverse of the axes.
        expected = (part.positions - centre) / np.ptp(part.positions, axis=0) ** 2
        unit = part.normals / np.linalg.norm(part.normals, axis=1, keepdims=True)
        expected /= np.linalg.norm(expected, axis=1, keepdims=True)
        assert np.einsum("ij,ij->i", unit, expected).min() > 0.99


def test_placed_often_is_read_once():
    """All copies are there, mirrored ones with their faces turned round; a bad face is no other copy's."""
    mesh = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 1, 3]], process=False)
    mesh.visual.vertex_colors = [[1, 2, 3, 255], [4, 5, 6, 255], [7, 8, 9, 255]]
    transforms = np.tile(np.eye(4), (200, 1, 1))
    transforms[:, 2, 3] = np.arange(200)
    transforms[1::2, 1, 1] = -1.0
    part = _placed(mesh_part(mesh), transforms)
    assert (len(part.positions), part.bad_faces, part.copies) == (600, 200, 200)
    corners = part.positions[part.faces]
    np.testing.assert_array_equal(corners[:, :, 2], np.repeat(np.arange(200.0)[:, None], 3, axis=1))
    np.testing.assert_array_equal(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2], 1.0)
    np.testing.assert_array_equal(np.sort(part.colors[part.faces, 0], axis=1), np.tile([1, 4, 7], (200, 1)))


def test_vertex_colours(tmp_path):
    mesh = box()
    mesh.visual.vertex_colors = np.tile([10, 20, 30, 255], (8, 1)).astype(np.uint8)
    mesh.export(tmp_path / "a.glb")
    assert np.unique(load_model(tmp_path / "a.glb").colors, axis=0).tolist() == [[10, 20, 30, 255]]


def test_face_colours_split_vertices():
    mesh = trimesh.Trimesh(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3], [0, 1, 9]], process=False
    )
    mesh.visual.face_colors = [[255, 0, 0, 255], [0, 0, 255, 128], [7, 7, 7, 7]]
    part = mesh_part(mesh)
    assert part.bad_faces == 1
    assert part.colors[part.faces].tolist() == [[[255, 0, 0, 255]] * 3, [[0, 0, 255, 128]] * 3]
    np.testing.assert_allclose(part.positions[part.faces], mesh.vertices[mesh.faces[:2]])


def test_one_colour_of_a_material(tmp_path):
    red = box()
    red.visual = trimesh.visual.TextureVisuals(
        uv=np.zeros((8, 2)), material=trimesh.visual.material.PBRMaterial(baseColorFactor=[255, 0, 0, 255])
    )
    grey = box()
    grey.visual = trimesh.visual.TextureVisuals(
        uv=np.zeros((8, 2)), material=trimesh.visual.material.PBRMaterial(baseColorFactor=[90, 90, 90, 255])
    )
    red.export(tmp_path / "red.glb")
    grey.export(tmp_path / "grey.glb")
    assert np.unique(load_model(tmp_path / "red.glb").colors, axis=0).tolist() == [[255, 0, 0, 255]]
    assert load_model(tmp_path / "grey.glb").colors is None


def test_a_textured_file_of_its_own(tmp_path):
    quad = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]], process=False)
    # Red below, green above: v runs up.
    image = np.zeros((64, 64, 3), np.uint8)
    image[:32, :, 1], image[32:, :, 0] = 255, 255
    quad.visual = trimesh.visual.TextureVisuals(
        uv=quad.vertices[:, :2], material=trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(image))
    )
    quad.export(tmp_path / "quad.glb")
    mesh = load_model(tmp_path / "quad.glb")
    below, above = mesh.positions[:, 1] < -0.05, mesh.positions[:, 1] > 0.05
    assert np.unique(mesh.colors[below], axis=0).tolist() == [[255, 0, 0, 255]]
    assert np.unique(mesh.colors[above], axis=0).tolist() == [[0, 255, 0, 255]]


def test_points_in_a_scene(tmp_path):
    points = np.random.default_rng(1).random((50, 3))
    trimesh.Scene(trimesh.PointCloud(points, colors=np.tile([1, 2, 3, 255], (50, 1)))).export(tmp_path / "points.glb")
    cloud = load_model(tmp_path / "points.glb")
    assert isinstance(cloud, PointCloud)
    np.testing.assert_allclose(in_file_space(cloud, cloud.positions), points, atol=1e-6)
    assert np.unique(cloud.colors, axis=0).tolist() == [[1, 2, 3, 255]]


def test_no_buffer_is_read_outside_the_folder(tmp_path):
    tree = json.loads(write_gltf(tmp_path, box()).read_text())
    inner = tmp_path / "inner"
    inner.mkdir()
    for buffer in tree["buffers"]:
        buffer["uri"] = "../" + buffer["uri"]
    (inner / "box.gltf").write_text(json.dumps(tree))
    with pytest.raises(ModelError, match=r"^box\.gltf: the file .*, which it refers to, is not in its folder$"):
        load_model(inner / "box.gltf")


def test_a_missing_image_is_only_missed(tmp_path):
    quad = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 1, 2]], process=False)
    image = Image.fromarray(np.full((4, 4, 3), 200, np.uint8))
    quad.visual = trimesh.visual.TextureVisuals(
        uv=quad.vertices[:, :2], material=trimesh.visual.material.PBRMaterial(baseColorTexture=image)
    )
    path = write_gltf(tmp_path, quad)
    tree = json.loads(path.read_text())
    tree["images"] = [{"uri": "skin.png"}]
    path.write_text(json.dumps(tree))
    image.save(tmp_path / "skin.png")
    assert load_model(path).colors is not None
    (tmp_path / "skin.png").unlink()
    mesh = load_model(path)
    assert mesh.colors is None
    assert mesh.warnings == ("the file skin.png is not in the model's folder",)


def refusal(path):
    with pytest.raises(ModelError) as caught:
        load_model(path)
    return str(caught.value).removeprefix(f"{path.name}: ")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits memory")
def test_a_small_archive_of_millions_of_triangles(tmp_path):
    box().export(tmp_path / "a.3mf")
    with zipfile.ZipFile(tmp_path / "a.3mf") as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(tmp_path / "a.3mf", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            triangles = b'<triangle v1="0" v2="1" v3="2"/>' * 1_100_000 + b"</triangles>"
            archive.writestr(name, data.replace(b"</triangles>", triangles))
    assert (tmp_path / "a.3mf").stat().st_size < 1e6
    assert refusal(tmp_path / "a.3mf").startswith(("damaged", "it unpacks to 1,100,0"))


def test_a_small_mesh_placed_many_times(tmp_path):
    path = write_gltf(tmp_path, trimesh.creation.icosphere(4))
    tree = json.loads(path.read_text())
    (mesh,) = (node["mesh"] for node in tree["nodes"] if "mesh" in node)
    tree["nodes"] = [{"mesh": mesh} for _ in range(300)]
    tree["scenes"] = [{"nodes": list(range(300))}]
    path.write_text(json.dumps(tree))
    assert refusal(path).startswith("it unpacks to 1,536,000 points or faces, too many")


def test_an_accessor_without_a_buffer(tmp_path):
    path = write_gltf(tmp_path, box())
    tree = json.loads(path.read_text())
    for accessor in tree["accessors"]:
        del accessor["bufferView"]
        accessor["count"] = 2**31
    path.write_text(json.dumps(tree))
    assert refusal(path).startswith("damaged")


LAUGHS = '<!ENTITY a0 "ha">' + "".join(f'<!ENTITY a{i + 1} "{f"&a{i};" * 10}">' for i in range(9))


@pytest.mark.parametrize("entity", ['<!ENTITY a9 SYSTEM "secret.txt">', LAUGHS], ids=["a file", "a billion laughs"])
def test_entities_that_stand_for_more(tmp_path, entity):
    (tmp_path / "secret.txt").write_text("Y_UP")
    box().export(tmp_path / "a.dae")
    text = (tmp_path / "a.dae").read_text()
    assert "<asset>" in text
    assert "</asset>" in text
    start = text.index("<COLLADA")
    text = f"{text[:start]}<!DOCTYPE COLLADA [{entity}]>{text[start:]}"
    (tmp_path / "a.dae").write_text(text.replace("</asset>", "<title>&a9;</title></asset>"))
    assert refusal(tmp_path / "a.dae") == "damaged, truncated or not a DAE file"
