import pytest

from hierarchy.references import inside_folder


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "secret.png").write_text("secret")
    model = tmp_path / "model"
    (model / "textures").mkdir(parents=True)
    (model / "skin.png").write_text("skin")
    (model / "textures" / "fur.png").write_text("fur")
    (model / "link.png").symlink_to(tmp_path / "secret.png")
    return model


@pytest.mark.parametrize(
    "name", ["skin.png", " skin.png\n", "./skin.png", "textures/../skin.png", "C:\\work\\skin.png", "/home/me/skin.png"]
)
def test_files_of_the_folder(folder, name):
    assert inside_folder(folder, name).read_text() == "skin"


@pytest.mark.parametrize("name", ["textures/fur.png", "textures\\fur.png"])
def test_files_below_the_folder(folder, name):
    assert inside_folder(folder, name).read_text() == "fur"


@pytest.mark.parametrize("name", ["../secret.png", "textures/../../secret.png", "link.png", "..\\secret.png"])
def test_nothing_outside_the_folder(folder, name):
    with pytest.raises(PermissionError):
        inside_folder(folder, name)
    with pytest.raises(PermissionError):
        inside_folder(folder, str(folder.parent / "secret.png"))


@pytest.mark.parametrize("name", ["none.png", "", "textures", ".", "skin\0.png"])
def test_what_is_not_there(folder, name):
    with pytest.raises(FileNotFoundError):
        inside_folder(folder, name)
