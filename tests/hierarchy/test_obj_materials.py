import pytest

from hierarchy.obj_materials import Material, read_materials


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("map_Kd skin.png", "skin.png"),
        ("  map_kd   my skin.png  ", "my skin.png"),
        ("map_Kd -clamp on -blendu off skin.png", "skin.png"),
        ("map_Kd -s 2 2 1 -o 0.5 skin.png", "skin.png"),
        ("map_Kd -s 2 my 3 skins.png", "my 3 skins.png"),
        ("map_Kd -mm 0 1 textures\\skin.png", "textures\\skin.png"),
        ("map_Kd", None),
        ("map_Bump skin.png", None),
    ],
)
def test_the_name_of_a_texture(tmp_path, line, name):
    (tmp_path / "a.mtl").write_text(f"# head\nKd 1 1 1\nnewmtl a\n{line}\n")
    assert read_materials(tmp_path, "a.mtl") == {"a": Material(None, name)}


def test_colours_are_clamped_and_damaged_ones_passed_over(tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl my red\nKd 2 -1 0.5\nnewmtl b\nKd red\nnewmtl c\nKd 1 1\n")
    assert read_materials(tmp_path, "a.mtl") == {
        "my red": Material((255, 0, 128, 255)), "b": Material(), "c": Material()}  # fmt: skip


def test_a_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_materials(tmp_path, "a.mtl")
