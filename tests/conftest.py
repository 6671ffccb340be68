"""What the tests of all rooms share."""

from pathlib import Path

import pytest

SHARED_MODELS = Path(__file__).resolve().parents[2] / "shared" / "models"


def pytest_addoption(parser):
    parser.addoption("--update-goldens", action="store_true", help="draw the golden pictures anew (tests/renderer)")


@pytest.fixture(scope="session")
def shared_models():
    """The folder of real models beside the repository; tests that need it are skipped where it is absent."""
    if not SHARED_MODELS.is_dir():
        pytest.skip(f"the folder of real models is absent: {SHARED_MODELS}")
    return SHARED_MODELS
