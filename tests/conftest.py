"""What the tests of all rooms share."""

from pathlib import Path

import pytest

SHARED_MODELS = Path(__file__).resolve().parents[2] / "shared" / "models"


def pytest_addoption(parser):
    parser.addoption("--update-goldens", action="store_true", help="draw the golden pictures anew (tests/renderer)")
    parser.addoption("--stress", action="store_true", help="try all cases of tests/stress, not only a fast share")
    parser.addoption("--stress-seed", type=int, default=20261122, help="where the generated cases start")
    parser.addoption("--stress-report", action="store_true", help="put what was found into docs/numerics.md")


@pytest.fixture(scope="session")
def shared_models():
    """The folder of real models beside the repository; tests that need it are skipped where it is absent."""
    if not SHARED_MODELS.is_dir():
        pytest.skip(f"the folder of real models is absent: {SHARED_MODELS}")
    return SHARED_MODELS
