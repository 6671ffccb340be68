import os
from pathlib import Path

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
    if hasattr(os, "mkfifo"):
        os.mkfifo(model / "pipe.png")
    return model


@pytest.mark.parametrize(
    "name",
    [
        "skin%2epng",
        "textures%2F..%2fskin.png",
        "%2Fhome%2Fme%2Fskin.png",
        "\\\\server\\share\\skin.png",
        "skin.png",
        " skin.png\n",
        "./skin.png",
        "textures/../skin.png",
        "C:\\work\\skin.png",
        "/home/me/skin.png",
    ],
)
def test_files_of_the_folder(folder, name):
    assert inside_folder(folder, name).read_text() == "skin"


@pytest.mark.parametrize("name", ["textures/fur.png", "textures\\fur.png"])
def test_files_below_the_folder(folder, name):
    assert inside_folder(folder, name).read_text() == "fur"


@pytest.mark.parametrize("name", ["../secret.png", "textures/../../secret.png", "link.png", "..\\secret.png",
                                  "%2e%2e/secret.png", "..%5csecret.png", "textures/../..\\secret.png"])  # fmt: skip
def test_nothing_outside_the_folder(folder, name):
    with pytest.raises(PermissionError):
        inside_folder(folder, name)
    with pytest.raises(PermissionError):
        inside_folder(folder, str(folder.parent / "secret.png"))


@pytest.mark.parametrize("name", ["none.png", "", "textures", ".", "skin\0.png", "skin.png%00", "%", "%zz",
                                  "data:image/png;base64,AAAA", "file:skin.jpg", "pipe.png"])  # fmt: skip
def test_what_is_not_there(folder, name):
    with pytest.raises(FileNotFoundError):
        inside_folder(folder, name)


def test_links_that_leave_or_lead_in_a_circle(folder):
    (folder / "circle.png").symlink_to("circle.png")
    (folder / "out").symlink_to(folder.parent)
    (folder / "textures" / "back.png").symlink_to("../skin.png")
    assert inside_folder(folder, "textures/back.png").read_text() == "skin"
    for name in ("circle.png", "out/secret.png"):
        with pytest.raises(PermissionError):
            inside_folder(folder, name)


def test_a_name_that_is_longer_than_names_can_be(folder):
    for name in ("x" * 100_000, "x/" * 50_000, "../" * 50_000):
        with pytest.raises((FileNotFoundError, PermissionError)):
            inside_folder(folder, name)


@pytest.mark.parametrize(
    "name", ["/etc/passwd", "//server/share/x.png", "\\\\server\\share\\x.png", "C:\\x.png", "%2f%2fserver%2fx.png"]
)
def test_other_machines_and_drives_are_not_even_asked(folder, name, monkeypatch):
    asked = []
    original = Path.resolve
    monkeypatch.setattr(Path, "resolve", lambda path, strict=False: asked.append(path) or original(path, strict))
    # On systems without drives C: is a folder that is not there.
    with pytest.raises((FileNotFoundError, PermissionError)):
        inside_folder(folder, name)
    assert all(path.is_relative_to(folder) for path in asked)
