"""What the tests of all rooms share."""

import itertools
import os
from pathlib import Path

import pytest

from app.kernels import keep_kernels_apart

# Before numba is imported, for the tests and for the processes that they start.
keep_kernels_apart(Path(__file__).resolve().parents[1] / "build" / "kernels")

SHARED_MODELS = Path(__file__).resolve().parents[2] / "shared" / "models"


def pytest_addoption(parser):
    parser.addoption("--update-goldens", action="store_true", help="draw the golden pictures anew (tests/renderer)")
    parser.addoption("--stress", action="store_true", help="try all cases of tests/stress, not only a fast share")
    parser.addoption("--stress-seed", type=int, default=20261122, help="where the generated cases start")
    parser.addoption("--stress-report", action="store_true", help="put what was found into docs/numerics.md")


@pytest.fixture(scope="session", autouse=True)
def _caches(tmp_path_factory):
    """A folder for the caches of all tests, and of the processes that they start: never the user's own."""
    folder = tmp_path_factory.mktemp("caches")
    before = os.environ.get("SURFELSCOPE_CACHE")
    os.environ["SURFELSCOPE_CACHE"] = str(folder / "shared")
    yield folder
    os.environ.pop("SURFELSCOPE_CACHE")
    if before is not None:
        os.environ["SURFELSCOPE_CACHE"] = before


_numbers = itertools.count()


@pytest.fixture(autouse=True)
def cache_folder(_caches, monkeypatch):
    """The folder of the cache of this test alone; it is not there yet."""
    folder = _caches / str(next(_numbers))
    monkeypatch.setenv("SURFELSCOPE_CACHE", str(folder))
    return folder


@pytest.fixture(scope="session")
def shared_models():
    """The folder of real models beside the repository; tests that need it are skipped where it is absent."""
    if not SHARED_MODELS.is_dir():
        pytest.skip(f"the folder of real models is absent: {SHARED_MODELS}")
    return SHARED_MODELS


@pytest.fixture(scope="session")
def gl_context():
    """An OpenGL context for all tests that draw; they are skipped where there is none."""
    from renderer.context import ContextError, create_headless_context

    try:
        context = create_headless_context()
    except ContextError as error:
        pytest.skip(str(error))
    yield context
    context.release()


@pytest.fixture
def ctx(gl_context):
    """The context of the session, current for one test: other tests have contexts of their own."""
    with gl_context:
        yield gl_context
        assert gl_context.error == "GL_NO_ERROR"
