"""The command line: every option, and one line for everything that is wrong with one."""

from pathlib import Path

import pytest

from app.errors import UsageError
from app.options import CameraOptions, Options, parse_options


def test_nothing_given_is_the_window_with_the_built_in_model():
    assert parse_options([]) == Options()


def test_all_options_of_render():
    line = (
        "render statue.ply --output a.png --output b.NPZ --r-sil 1.5 --r-inner 24 --w-s 8 --no-normal-mapping --points "
        "--texture skin.png --resolution 640,480 --camera-position 1,2,3 --camera-focal-point=0,0.5,0 "
        "--camera-view-up 0,0,1 --camera-view-angle 30 --camera-orthographic --frames 5 --json --verbose"
    )
    assert parse_options(line.split()) == Options(
        command="render",
        model=Path("statue.ply"),
        r_sil=1.5,
        r_inner=24.0,
        texels=8,
        normal_mapping=False,
        points=True,
        texture=Path("skin.png"),
        resolution=(640, 480),
        camera=CameraOptions((1.0, 2.0, 3.0), (0.0, 0.5, 0.0), (0.0, 0.0, 1.0), 30.0, orthographic=True),
        outputs=(Path("a.png"), Path("b.NPZ")),
        frames=5,
        json=True,
        verbose=True,
    )


def test_window_takes_model_and_options():
    options = parse_options(["bunny.obj", "--r-sil", "0"])
    assert (options.command, options.model, options.r_sil) == ("window", Path("bunny.obj"), 0.0)


def test_goals_and_what_is_for_comparison():
    for command in ("window", "render"):
        line = "--max-error 0.8,0.25 --fps 24.5 --splat sprite"
        options = parse_options([*(["render", "--json"] if command == "render" else []), *line.split()])
        assert (options.max_error, options.fps) == ((0.8, 0.25), 24.5)
        assert (options.splat, options.printed_cone_test) == ("sprite", False)
    assert parse_options(["--max-error", "2"]).max_error == (2.0, 0.5)
    assert not parse_options(["--max-error", "1", "--cone-test", "own"]).printed_cone_test
    assert parse_options(["--cone-test", "printed"]).printed_cone_test


def test_info_takes_json():
    options = parse_options(["info", "bunny.obj", "--json"])
    assert (options.command, options.model, options.json) == ("info", Path("bunny.obj"), True)


def test_negative_coordinates_need_no_equals_sign():
    options = parse_options(["--camera-position", "-1,-.5,2", "--camera-view-up", "-0.5,1,0"])
    assert options.camera.position == (-1.0, -0.5, 2.0)
    assert options.camera.view_up == (-0.5, 1.0, 0.0)


def test_render_for_its_statistics_alone():
    assert parse_options(["render", "--json"]).outputs == ()


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("--r-sil -1", "less than 0"),
        ("--max-error nan", "not a number of degrees"),
        ("--max-error 1,inf", "not a number of degrees"),
        ("--max-error 1,", "not a number of degrees"),
        ("--max-error 1,2,3", "not a number of degrees"),
        ("--max-error small", "not a number of degrees"),
        ("--max-error -1", "no error greater than 0"),
        ("--max-error 1,0", "no error greater than 0"),
        ("--max-error 1 --r-sil 2", "--max-error decides about --r-sil itself"),
        ("render --json --w-s 8 --max-error 1 --r-inner 2", "--max-error decides about --r-inner and --w-s itself"),
        ("--max-error 1 --no-normal-mapping", "does not go with --no-normal-mapping"),
        ("--max-error 1 --cone-test printed", "does not go with --cone-test printed"),
        ("--fps 0", "between 1 and 1000"),
        ("--fps -20", "between 1 and 1000"),
        ("--fps nan", "not a number of frames"),
        ("--fps fast", "not a number of frames"),
        ("--splat cube", "'quad', 'sprite'"),
        ("--cone-test none", "'own', 'printed'"),
        ("info --max-error 1", "unrecognized"),
        ("info --fps 20", "unrecognized"),
        ("--r-inner nan", "not a number of pixels"),
        ("--r-inner inf", "not a number of pixels"),
        ("--w-s 3", "none of 2, 4, 8, 16, 32"),
        ("--w-s 2.5", "not a whole number"),
        ("--resolution 0,10", "between 1,1 and"),
        ("--resolution 100", "a width and a height"),
        ("--resolution 99999,10", "between 1,1 and"),
        ("--camera-position 1,2", "three numbers"),
        ("--camera-position 1,2,nan", "three numbers"),
        ("--camera-view-up 0,0,0", "no direction"),
        ("--camera-view-angle 180", "between 0 and 180"),
        ("--camera-view-angle 0", "between 0 and 180"),
        ("--camera-view-angle wide", "an angle in degrees"),
        ("render", "needs --output"),
        ("render --output picture.jpg", "neither in .png nor in .npz"),
        ("render --output a.png --frames 0", "between 1 and"),
        ("--output a.png", "unrecognized"),
        ("info --r-sil 2", "unrecognized"),
        ("--r-si 2", "unrecognized"),
        ("one.ply two.ply", "unrecognized"),
        ("--r-sil", "expected one argument"),
    ],
)
def test_bad_line_is_one_line(line, told):
    with pytest.raises(UsageError) as error:
        parse_options(line.split())
    assert told in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("command", [[], ["render"], ["info"]])
def test_help_explains_and_succeeds(command, capsys):
    with pytest.raises(SystemExit) as exit_status:
        parse_options([*command, "--help"])
    assert exit_status.value.code == 0
    assert "--w-s N" in capsys.readouterr().out
