"""The command line: what can be asked for, and what a bad value is answered with."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import NoReturn

from app.errors import UsageError

TEXELS = (2, 4, 8, 16, 32)
COMMANDS = ("render", "info")
# Read by benchmarks/options.py.
BENCH = "bench"
OUTPUT_SUFFIXES = (".png", ".npz")

# The largest side of a picture that every OpenGL 3.3 driver in use accepts.
MAX_RESOLUTION = 16384

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class CameraOptions:
    """What the user fixed of the camera; None: chosen to fit the model.

    position, focal_point : the file's own space
    view_up : a direction
    view_angle : degrees, full vertical field of view
    """

    position: Vector | None = None
    focal_point: Vector | None = None
    view_up: Vector | None = None
    view_angle: float = 45.0


@dataclass(frozen=True)
class Options:
    """A whole command line, checked.

    command : "window", "render" or "info"
    model : path of the model, None: the built-in one
    r_sil, r_inner : largest radii in pixels of silhouette and other surfels
    texels : texels along one side of a normal tile, the paper's w_s
    points : build a point hierarchy from a mesh, too
    resolution : width and height in pixels, None: not given
    outputs : files to write (render)
    frames : how many to draw (render)
    """

    command: str = "window"
    model: Path | None = None
    r_sil: float = 2.0
    r_inner: float = 16.0
    texels: int = 16
    normal_mapping: bool = True
    points: bool = False
    texture: Path | None = None
    resolution: tuple[int, int] | None = None
    camera: CameraOptions = CameraOptions()
    outputs: tuple[Path, ...] = ()
    frames: int = 1
    json: bool = False
    verbose: bool = False


def parse_options(arguments: Sequence[str]) -> Options:
    """Read a command line, without the program's name.

    Raises UsageError. `--help` and `--version` print and raise SystemExit(0), as argparse does.
    """
    command = arguments[0] if arguments and arguments[0] in COMMANDS else "window"
    rest = list(arguments) if command == "window" else list(arguments[1:])
    values = vars(_parser(command).parse_args(_join_negative_numbers(rest)))
    camera = CameraOptions(**{name: values.pop(f"camera_{name}") for name in _CAMERA if f"camera_{name}" in values})
    options = Options(command=command, camera=camera, **values)
    if command == "render" and not options.outputs and not options.json:
        raise UsageError("render needs --output FILE.png or FILE.npz, or --json")
    return options


class _Parser(argparse.ArgumentParser):
    """Answers a bad command line with one line instead of the whole usage."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message} (see {self.prog} --help)")


_CAMERA = ("position", "focal_point", "view_up", "view_angle")

_USAGE = {
    "window": "%(prog)s [MODEL] [options]\n       %(prog)s render [MODEL] --output FILE [options]\n"
    "       %(prog)s info [MODEL] [--json]\n       %(prog)s bench [MODEL ...] [options]",
    "render": "%(prog)s [MODEL] --output FILE [options]",
    "info": "%(prog)s [MODEL] [--json]",
}

_DESCRIPTION = {
    "window": "Look at a very detailed model in a window. Without MODEL: a procedural meteoroid.",
    "render": "Draw a model without a window.",
    "info": "Say what a file holds and what is built from it.",
}


def _parser(command: str) -> _Parser:
    parser = _Parser(
        prog="surfelscope" if command == "window" else f"surfelscope {command}",
        usage=_USAGE[command],
        description=_DESCRIPTION[command],
        epilog="Coordinates are in the file's own space, sizes on screen in pixels.",
        allow_abbrev=False,
        argument_default=argparse.SUPPRESS,
    )
    parser.add_argument("model", metavar="MODEL", nargs="?", default=None, type=Path, help="a mesh or a point cloud")
    _add_model_options(parser)
    if command != "info":
        _add_picture_options(parser)
        _add_camera_options(parser)
    if command == "render":
        parser.add_argument(
            "--output", metavar="FILE", dest="outputs", action=_AddOutput, type=_output,
            help="FILE.png: the shaded picture, FILE.npz: its arrays; may be given several times",
        )  # fmt: skip
        parser.add_argument("--frames", metavar="N", type=_whole(1, 1_000_000), help="draw N frames, report medians")
    if command != "window":
        parser.add_argument("--json", action="store_true", help="statistics on standard output")
    parser.add_argument("--version", action="version", version=f"surfelscope {_version()}")
    parser.add_argument("--verbose", action="store_true", help="say on standard error what is being done")
    return parser


def _version() -> str:
    try:
        return metadata.version("surfelscope")
    except metadata.PackageNotFoundError:
        return "(not installed)"


def _add_model_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("model")
    group.add_argument("--points", action="store_true", help="build a point hierarchy from a mesh, too")
    group.add_argument("--texture", metavar="FILE", type=Path, help="colour the surfels by FILE")
    group.add_argument(
        "--w-s", metavar="N", dest="texels", type=_texels, help="texels along one side of a normal tile (16)"
    )


def _add_picture_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("picture")
    group.add_argument("--r-sil", metavar="PX", type=_radius, help="largest radius of a silhouette surfel (2)")
    group.add_argument("--r-inner", metavar="PX", type=_radius, help="largest radius of any other surfel (16)")
    group.add_argument(
        "--no-normal-mapping", dest="normal_mapping", action="store_false", help="draw without the normal tiles"
    )
    group.add_argument("--resolution", metavar="W,H", type=_resolution, help="size of the picture in pixels")


def _add_camera_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("camera", "What is not given is chosen to fit the model.")
    group.add_argument("--camera-position", metavar="X,Y,Z", type=_vector, help="where the eye is")
    group.add_argument("--camera-focal-point", metavar="X,Y,Z", type=_vector, help="what it looks at")
    group.add_argument("--camera-view-up", metavar="X,Y,Z", type=_direction, help="the direction that is up")
    group.add_argument("--camera-view-angle", metavar="DEG", type=_view_angle, help="vertical field of view (45)")


class _AddOutput(argparse.Action):
    """Collects a tuple, where argparse's own "append" would make a list."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: object, option: str | None = None
    ) -> None:
        setattr(namespace, self.dest, (*getattr(namespace, self.dest, ()), values))


def _join_negative_numbers(arguments: list[str]) -> list[str]:
    """Let `--camera-position -1,0,2` mean `--camera-position=-1,0,2`; argparse would take -1,0,2 for an option."""
    joined: list[str] = []
    for argument in arguments:
        is_number = len(argument) > 1 and argument[0] == "-" and (argument[1].isdigit() or argument[1] == ".")
        if is_number and joined and joined[-1].startswith("--") and "=" not in joined[-1]:
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined


def _numbers(text: str, count: int, kind: Callable[[str], float], what: str) -> tuple[float, ...]:
    try:
        values = tuple(kind(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not all(math.isfinite(value) for value in values):
        raise argparse.ArgumentTypeError(f"{text!r} is not {what}")
    return values


def _radius(text: str) -> float:
    (value,) = _numbers(text, 1, float, "a number of pixels")
    if value < 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} is less than 0 pixels")
    return value


def _texels(text: str) -> int:
    (value,) = _numbers(text, 1, int, "a whole number")
    if value not in TEXELS:
        raise argparse.ArgumentTypeError(f"{text!r} is none of {', '.join(map(str, TEXELS))}")
    return int(value)


def _whole(least: int, most: int) -> Callable[[str], int]:
    def parse(text: str) -> int:
        (value,) = _numbers(text, 1, int, "a whole number")
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text!r} does not lie between {least} and {most}")
        return int(value)

    return parse


def _vector(text: str) -> Vector:
    x, y, z = _numbers(text, 3, float, "three numbers X,Y,Z")
    return x, y, z


def _direction(text: str) -> Vector:
    direction = _vector(text)
    if not any(direction):
        raise argparse.ArgumentTypeError("0,0,0 is no direction")
    return direction


def _view_angle(text: str) -> float:
    (value,) = _numbers(text, 1, float, "an angle in degrees")
    if not 0.0 < value < 180.0:
        raise argparse.ArgumentTypeError(f"{text!r} does not lie between 0 and 180 degrees")
    return value


def _resolution(text: str) -> tuple[int, int]:
    width, height = _numbers(text, 2, int, "a width and a height W,H")
    if not (1 <= width <= MAX_RESOLUTION and 1 <= height <= MAX_RESOLUTION):
        raise argparse.ArgumentTypeError(f"{text!r} does not lie between 1,1 and {MAX_RESOLUTION},{MAX_RESOLUTION}")
    return int(width), int(height)


def _output(text: str) -> Path:
    path = Path(text)
    if path.suffix.lower() not in OUTPUT_SUFFIXES:
        raise argparse.ArgumentTypeError(f"{text!r} ends neither in .png nor in .npz")
    return path
