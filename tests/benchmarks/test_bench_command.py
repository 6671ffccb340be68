"""`surfelscope bench` from the command line to the files: whole, interrupted, resumed and refused."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from small_models import bumpy_sphere

from app.cli import main
from app.errors import OutputError, UsageError
from benchmarks.command import run_bench
from benchmarks.methods import METHODS
from benchmarks.options import parse_bench_options
from benchmarks.promise_check import GOALS, OF_THE_SWEEP, describe_goal
from benchmarks.run_file import Run, Setting, read_run, write_run
from benchmarks.sweep import is_usual, settings_of
from benchmarks.views import views_of
from hierarchy.model import Mesh, ModelError
from hierarchy.view import View
from renderer.context import ContextError, create_headless_context

for package in ("embreex", "flip_evaluator", "matplotlib", "skimage"):
    pytest.importorskip(package, reason="the benchmarks need it")

ROOT = Path(__file__).parents[2]
TINY = ("--quick", "--views", "one", "--no-scaling", "--no-plots", "--rounds", "1", "--samples", "2")
SMALL = (*TINY, "--resolution", "64,48")


def write_obj(path: Path, mesh: Mesh) -> Path:
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in mesh.positions]
    lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture(scope="module")
def model(tmp_path_factory) -> Path:
    try:
        create_headless_context().release()
    except ContextError as error:
        pytest.skip(str(error))
    return write_obj(tmp_path_factory.mktemp("models") / "lumps.obj", bumpy_sphere(8))


VIEWS = ("front", "inside")


def a_few_views(mesh: Mesh, resolution: tuple[int, int]) -> dict[str, View]:
    """Return two of the views, in place of all."""
    views = views_of(mesh, resolution)
    return {name: views[name] for name in VIEWS if name in views}


def a_few_settings(model: str, *_: object, **__: object) -> list[Setting]:
    """Return some settings of every method, in place of the sweep's."""
    settings = settings_of(model, VIEWS, ["front"], closed=True, quick=True, everywhere=True)
    return [each for each in settings if each.r_inner in (0.0, 4.0, 16.0) and each.r_sil != 1.0]


MEASURE_A_FEW = """
import sys
import app.cli, benchmarks.plan, benchmarks.environment, test_bench_command
benchmarks.plan.settings_of = test_bench_command.a_few_settings
benchmarks.plan.views_of = test_bench_command.a_few_views
benchmarks.plan.GOALS = benchmarks.plan.GOALS[:1]
benchmarks.environment.code_digest = lambda _: "code"
sys.exit(app.cli.main(sys.argv[1:]))
"""


@pytest.fixture(scope="module", autouse=True)
def few_settings() -> Iterator[None]:
    """Measure few settings, and let nobody mind who edits the code while the tests run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("benchmarks.plan.settings_of", a_few_settings)
        patch.setattr("benchmarks.plan.views_of", a_few_views)
        patch.setattr("benchmarks.plan.GOALS", GOALS[:1])
        patch.setattr("benchmarks.environment.code_digest", lambda _: "code")
        yield


@pytest.fixture(scope="module")
def output(model, few_settings, tmp_path_factory) -> Path:
    """The run file of a run that was interrupted once and then resumed."""
    path = tmp_path_factory.mktemp("bench") / "new" / "run.json"
    command = [sys.executable, "-c", MEASURE_A_FEW, "bench", str(model), *SMALL, "--output", str(path)]
    folders = os.pathsep.join(map(str, (ROOT, ROOT / "tests" / "reference", Path(__file__).parent)))
    process = subprocess.Popen(command, env={**os.environ, "PYTHONPATH": folders}, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 100.0
    while process.poll() is None and time.monotonic() < deadline:
        if path.exists() and len(read_run(path).records) >= 3:
            break
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, complaints = process.communicate(timeout=30)
    assert (process.returncode, b"Traceback" in complaints) == (130, False), complaints
    before = path.read_text()
    assert 3 <= len(read_run(path).records) < len(a_few_settings("lumps.obj"))
    run_bench([str(model), *SMALL, "--output", str(path)])
    # What was measured before stays as it is.
    records = [line.rstrip(",]") for line in before.splitlines() if line.startswith(' {"model"')]
    assert all(line in path.read_text() for line in records)
    return path


def test_an_interrupted_run_goes_on_to_the_whole(output):
    run = read_run(output)
    settings = [record.setting for record in run.records]
    assert len(settings) == len(set(settings))
    assert set(settings) == set(a_few_settings("lumps.obj"))
    with output.with_suffix(".csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(settings)


def test_every_record_has_cost_and_error(output):
    always = ["cost.frame_ms.median", "cost.triangles_ms.min", "cost.frame_over_triangles", "cost.pixels_blended",
              "cost.gpu_bytes", "cost.peak_memory_mb", "error.normal_degrees.mean", "error.silhouette.mean",
              "error.silhouette.hausdorff", "error.iou", "error.depth_relative.p95", "error.psnr",
              "error.ssim"]  # fmt: skip
    splats = ["cost.select_ms.median", "cost.visibility_ms.median", "cost.attributes_ms.median",
              "cost.resolve_ms.spread", "cost.splats", "cost.visited_nodes"]  # fmt: skip
    for record in read_run(output).records:
        drawn = METHODS[record.setting.method].select is not None
        for name in always + (splats if drawn else []):
            assert np.isfinite(record.value(name)), (record.setting, name)
        assert np.isfinite(record.value("error.flip")) == is_usual(record.setting)
        assert record.value("cost.splats") + record.value("cost.triangles") > 0
        assert (record.value("cost.tile_bytes") > 0) == (record.setting.w_s > 0)


def value(run: Run, name: str, method: str, r_sil: float = 0.0, r_inner: float = 0.0, w_s: int = 0) -> float:
    (found,) = (
        record.value(name)
        for record in run.records
        if (record.setting.view, record.setting.method) == ("front", method)
        and (record.setting.r_sil, record.setting.r_inner, record.setting.w_s) == (r_sil, r_inner, w_s)
    )
    return found


def test_figures_are_in_the_order_that_they_must_be(output):
    run = read_run(output)
    error = "error.normal_degrees.mean"
    floor = value(run, error, "triangles")
    assert floor <= value(run, error, "surfelscope", 2.0, 16.0, 16) < value(run, error, "no tiles", 2.0, 16.0)
    assert value(run, error, "triangles, culled") == floor
    # What is culled does not hide behind, or is not drawn over by, what comes later.
    pixels = "cost.pixels_blended"
    assert value(run, pixels, "triangles, culled") < value(run, pixels, "triangles")
    assert value(run, "cost.splats", "one radius", 4.0, 4.0) < value(run, "cost.splats", "base surfels flat")
    assert value(run, "cost.gpu_bytes", "surfelscope", 2.0, 16.0, 16) > value(
        run, "cost.gpu_bytes", "no tiles", 2.0, 16.0
    )


def test_models_and_environment_are_described(output):
    run = read_run(output)
    assert run.settings == {"resolution": [64, 48], "rounds": 1, "samples": 2, "view_angle": 45.0}
    model = run.models["lumps.obj"]
    assert (model["triangles"], model["closed"]) == (20 * 8**2, True)
    assert len(model["content"]) == 64
    assert model["bake_s"].keys() == model["tile_bytes"].keys() == {"4", "8", "16"}
    assert min(model["load_s"], model["build_s"], model["points_build_s"], *model["bake_s"].values()) > 0.0
    assert {"code", "cpu", "cores", "gl_renderer", "python", "date"} <= run.environment.keys()


def test_promises_are_compared_with_what_is_measured(output):
    run = read_run(output)
    goals = [entry for entry in run.bounds if entry["goal"] == describe_goal(GOALS[0])]
    swept = [entry for entry in run.bounds if entry["goal"] == OF_THE_SWEEP]
    assert len(goals) + len(swept) == len(run.bounds)
    assert len({entry["view"] for entry in goals}) == len(goals) == len(VIEWS)
    own = [record for record in run.records if record.setting.method == "surfelscope"]
    for entry, record in zip(swept, own, strict=True):
        assert (entry["view"], entry["r_inner"]) == (record.setting.view, record.setting.r_inner)
        assert entry["measured"]["degrees"] == record.value("error.normal_degrees.mean")
        assert entry["promised"]["degrees"] > 0.0
    for entry in goals:
        assert entry["keeps"] == (entry["promised"]["degrees"] <= 0.5 and entry["promised"]["pixels"] <= 0.3)


def test_a_finished_run_is_left_alone(model, output, capsys):
    before = output.read_text()
    assert main(["bench", str(model), *SMALL, "--output", str(output)]) == 0
    assert output.read_text() == before
    assert str(output) in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "reason"),
    [(("--resolution", "48,64"), "with other resolution"), (("--rounds", "2"), "with other rounds")],
)
def test_a_run_with_other_settings_is_refused(model, output, change, reason, capsys):
    assert main(["bench", str(model), *SMALL, *change, "--output", str(output)]) == 2
    said = capsys.readouterr().err
    assert reason in said
    assert "--restart" in said
    assert said.count("\n") == 1


def test_a_comparison_with_itself_finds_nothing_and_with_a_better_one_something(model, output, tmp_path, capsys):
    line = ["bench", str(model), *SMALL, "--output", str(output), "--compare"]
    assert main([*line, str(output)]) == 0
    assert "0 flagged" in capsys.readouterr().out
    better = read_run(output)
    for record in better.records:
        record.cost["frame_over_triangles"] *= 0.5
    write_run(tmp_path / "better.json", better)
    assert main([*line, str(tmp_path / "better.json")]) == 1
    assert "frame / triangles" in capsys.readouterr().out


def test_plots_lie_beside_the_run_and_a_page_is_filled_in(model, output, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("benchmarks.plan.settings_of", lambda *_, **__: [next(iter(read_run(output).records)).setting])
    path, page = tmp_path / "run.json", tmp_path / "docs" / "page.md"
    shown = [each for each in SMALL if each != "--no-plots"]
    assert main(["bench", str(model), *shown, "--output", str(path)]) == 0
    said, progress = (text.splitlines() for text in capsys.readouterr())
    assert str(path) in said
    # As many steps were announced as were done.
    assert progress[-1].startswith(f"{len(progress)}/{len(progress)}  lumps.obj: heat map")
    assert (tmp_path / "plots" / "heat-map-lumps.png").stat().st_size > 1000
    page.parent.mkdir()
    page.write_text("Before\n<!-- bench:machine -->\n<!-- /bench:machine -->\nafter\n")
    assert main(["bench", str(model), *shown, "--output", str(path), "--report", str(page)]) == 0
    assert read_run(path).environment["gl_renderer"] in page.read_text()
    assert page.read_text().startswith("Before")


def test_what_is_to_be_shown_is_looked_for_before_anything_is_measured(model, tmp_path):
    for option, name in (("--compare", "old.json"), ("--report", "page.md")):
        with pytest.raises(UsageError, match=name):
            run_bench([str(model), *SMALL, "--output", str(tmp_path / "run.json"), option, str(tmp_path / name)])
    assert not (tmp_path / "run.json").exists()


def test_restart_begins_anew(model, output, tmp_path, monkeypatch):
    monkeypatch.setattr("benchmarks.plan.settings_of", lambda *_, **__: [next(iter(read_run(output).records)).setting])
    path = tmp_path / "run.json"
    path.write_text(output.read_text())
    run_bench([str(model), *SMALL, "--rounds", "2", "--output", str(path), "--restart"])
    assert len(read_run(path).records) == 1
    assert read_run(path).settings["rounds"] == 2


def test_an_open_model_is_lit_from_both_sides(tmp_path, monkeypatch):
    """The triangles' picture is that of the truth also where they are seen from behind."""
    mesh = bumpy_sphere(6)
    # Without its front the inside of the sphere is seen.
    kept = mesh.positions[mesh.faces].mean(axis=1)[:, 2] < 0.0
    half = Mesh("half", mesh.origin, mesh.positions, mesh.faces[kept], mesh.normals)
    path = tmp_path / "run.json"

    def only_triangles(model: str, *_: object, **__: object) -> list:
        return [s for s in settings_of(model, ["front"], ["front"], closed=False, quick=True, everywhere=False)
                if s.method in ("triangles", "surfelscope") and s.r_inner in (0.0, 8.0)]  # fmt: skip

    monkeypatch.setattr("benchmarks.plan.settings_of", only_triangles)
    run_bench([str(write_obj(tmp_path / "half.obj", half)), *SMALL, "--samples", "4", "--output", str(path)])
    run = read_run(path)
    assert not run.models["half.obj"]["closed"]
    assert value(run, "error.psnr", "triangles") > 20.0
    assert value(run, "error.psnr", "surfelscope", 2.0, 8.0, 16) > 20.0


def test_a_point_cloud_is_refused(tmp_path, capsys):
    points = tmp_path / "cloud.xyz"
    np.savetxt(points, np.random.default_rng(1).normal(size=(60, 3)))
    assert main(["bench", str(points), *SMALL, "--output", str(tmp_path / "run.json")]) == 2
    said = capsys.readouterr().err
    assert "a point cloud has no surface to compare with" in said
    assert said.count("\n") == 1


def test_a_model_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ModelError, match=r"nothing\.ply"):
        run_bench([str(tmp_path / "nothing.ply"), *SMALL, "--output", str(tmp_path / "run.json")])


def test_two_models_of_one_name_are_refused(model, tmp_path):
    other = write_obj(tmp_path / "lumps.obj", bumpy_sphere(3))
    with pytest.raises(UsageError, match=r"two models are called lumps\.obj"):
        run_bench([str(model), str(other), *SMALL, "--output", str(tmp_path / "run.json")])


def test_a_place_that_cannot_be_written_is_refused_before_anything_is_measured(model, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        run_bench([str(model), *SMALL, "--output", str(tmp_path / "file" / "run.json")])


def test_a_missing_package_is_named_with_the_way_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "flip_evaluator", None)
    with pytest.raises(UsageError, match=r"flip-evaluator: pip install 'surfelscope\[bench\]'"):
        run_bench([*SMALL, "--output", str(tmp_path / "run.json")])


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (["--output", "run.txt"], "does not end in .json"),
        (["--resolution", "64"], "no width and height"),
        (["--resolution", "4,4"], "between 8 and"),
        (["--rounds", "0"], "between 1 and"),
        (["--samples", "many"], "no whole number"),
        (["--views", "some"], "invalid choice"),
        (["--what"], "unrecognized"),
    ],
)
def test_a_bad_command_line_is_answered_in_one_line(line, reason):
    with pytest.raises(UsageError, match=reason) as refused:
        parse_bench_options(line)
    assert "\n" not in str(refused.value)


def test_what_the_command_line_means():
    options = parse_bench_options(["built-in", "a.ply", "--quick", "--no-scaling"])
    assert options.models == (None, Path("a.ply"))
    assert (options.views, options.quick, options.scaling, options.plots) == ("one", True, False, True)
    plain = parse_bench_options([])
    assert (plain.models, plain.views, plain.quick, plain.scaling) == ((None,), "all", False, True)
