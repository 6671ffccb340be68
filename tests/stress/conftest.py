"""How much the stress tests try: a fast share in `make test`, all of it in `make stress`."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from ledger import Ledger, fill_in
from stage import Stage

from renderer.renderer import Renderer

PAGE = Path(__file__).resolve().parents[2] / "docs" / "numerics.md"
LEDGER = Ledger()

_COMMON = {
    "derandomize": True,
    "deadline": None,
    "print_blob": True,
    "suppress_health_check": [HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
}
FAST = settings(max_examples=40, **_COMMON)
ALL = settings(max_examples=2_000, **_COMMON)


@pytest.fixture(scope="session")
def ledger() -> Ledger:
    """Where a test notes what it tried and the worst that it found."""
    return LEDGER


@pytest.fixture(scope="session")
def amount(pytestconfig: pytest.Config) -> Callable[[int, int], int]:
    """amount(fast, everything) is how many cases to try."""
    stressed = pytestconfig.getoption("--stress")
    return lambda fast, everything: everything if stressed else fast


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    """Random numbers that are the same in every run with the same --stress-seed, and of its own for every test."""
    seed = request.config.getoption("--stress-seed")
    return np.random.default_rng([seed, zlib.crc32(request.node.nodeid.encode())])


@pytest.fixture
def laws(pytestconfig: pytest.Config) -> settings:
    """Settings of hypothesis for properties that a test defines inside itself: `@laws @given(...) def law(...)`."""
    return ALL if pytestconfig.getoption("--stress") else FAST


@pytest.fixture
def renderer(ctx: moderngl.Context) -> Iterator[Renderer]:
    made = Renderer(ctx)
    yield made
    # moderngl binds the last framebuffer again after it read another one; that must not be one that is gone.
    ctx.detect_framebuffer(0).use()
    made.release()


@pytest.fixture(scope="module")
def stage(gl_context: moderngl.Context) -> Iterator[Stage]:
    """A renderer that a module's tests share: compiling its shaders takes longer than most of their pictures."""
    with gl_context:
        made = Stage(gl_context)
        yield made
        made.release()


def pytest_report_header(config: pytest.Config) -> str:
    return (
        f"stress: {'all' if config.getoption('--stress') else 'fast share'}, seed {config.getoption('--stress-seed')}"
    )


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if not LEDGER.rows:
        return
    terminalreporter.section("stress")
    for (section, what), row in LEDGER.rows.items():
        terminalreporter.line(
            f"{section}: {what}: {row.cases:,} cases, worst {row.worst:.3g} of {row.bound:.3g} {row.unit}"
        )
    terminalreporter.line(f"{LEDGER.cases():,} generated cases, of them {LEDGER.cases('files'):,} files")


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Bring the page up to date with what a whole, successful run found."""
    if exitstatus == 0 and session.config.getoption("--stress-report") and PAGE.exists():
        PAGE.write_text(fill_in(PAGE.read_text("utf-8"), LEDGER), "utf-8")
