"""The command line: what can be asked for, and what a bad value is answered with."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import NoReturn

from app import option_values
from app.errors import UsageError
from app.option_values import Vector
from renderer.settings import SPLATS

COMMANDS = ("render", "info", "cache")
# Read by benchmarks/options.py.
BENCH = "bench"

MODEL_HELP = (
    "a mesh or a point cloud: PLY, OBJ, STL, OFF, glTF, 3MF, COLLADA, LAS, LAZ, E57, points as text, or what else "
    "trimesh reads"
)


@dataclass(frozen=True)
class CameraOptions:
    """What the user fixed of the camera; None: chosen to fit the model.

    position, focal_point : the file's own space
    view_up : a direction
    view_angle : degrees, full vertical field of view
    orthographic : the view rays are parallel; the view angle then tells how much is seen at the focal point
    """

    position: Vector | None = None
    focal_point: Vector | None = None
    view_up: Vector | None = None
    view_angle: float = 45.0
    orthographic: bool = False


@dataclass(frozen=True)
class Options:
    """A whole command line, checked.

    command : "window", "render", "info" or "cache"
    model : path of the model, None: the built-in one
    r_sil, r_inner : largest radii in pixels of silhouette and other surfels
    texels : most texels along one side of a normal tile, the paper's w_s
    baked_texels : the same of the tiles to bake for all nodes, None: none (info)
    max_error : largest mean error in degrees (normals) and pixels (outline) that the three follow from, None: they are
        as given
    fps : frames a second to hold by drawing coarser, None: as many as there are
    splat : one of SPLATS
    printed_cone_test : tell the silhouette by the test as printed in the paper
    points : build a point hierarchy from a mesh, too
    tile_memory : MB (1e6 bytes) of graphics memory that the normal tiles may take, None: 134
    resolution : width and height in pixels, None: not given
    outputs : files to write (render)
    frames : how many to draw (render)
    cache : take models from the cache and put them there
    clear : empty the cache (cache)
    """

    command: str = "window"
    model: Path | None = None
    r_sil: float = 2.0
    r_inner: float = 16.0
    texels: int = 16
    baked_texels: int | None = None
    max_error: tuple[float, float] | None = None
    fps: float | None = None
    splat: str = "quad"
    printed_cone_test: bool = False
    normal_mapping: bool = True
    points: bool = False
    texture: Path | None = None
    tile_memory: int | None = None
    resolution: tuple[int, int] | None = None
    camera: CameraOptions = CameraOptions()
    outputs: tuple[Path, ...] = ()
    frames: int = 1
    cache: bool = True
    clear: bool = False
    json: bool = False
    verbose: bool = False

    @property
    def tile_bytes(self) -> int | None:
        return None if self.tile_memory is None else 1_000_000 * self.tile_memory


def parse_options(arguments: Sequence[str]) -> Options:
    """Read a command line, without the program's name.

    Raises UsageError. `--help` and `--version` print and raise SystemExit(0), as argparse does.
    """
    command = arguments[0] if arguments and arguments[0] in COMMANDS else "window"
    rest = list(arguments) if command == "window" else list(arguments[1:])
    values = vars(_parser(command).parse_args(_join_negative_numbers(rest)))
    if "max_error" in values:
        _check_alone(values)
    camera = CameraOptions(**{name: values.pop(f"camera_{name}") for name in _CAMERA if f"camera_{name}" in values})
    options = Options(command=command, camera=camera, **values)
    if command == "render" and not options.outputs and not options.json:
        raise UsageError("render needs --output FILE.png or FILE.npz, or --json")
    return options


def _check_alone(values: Mapping[str, object]) -> None:
    """Refuse an error goal beside what it decides."""
    decided = {"r_sil": "--r-sil", "r_inner": "--r-inner", "texels": "--w-s"}
    given = [option for name, option in decided.items() if name in values]
    if given:
        raise UsageError(f"--max-error decides about {' and '.join(given)} itself: give the one or the other")
    if "normal_mapping" in values:
        raise UsageError("--max-error counts on the normal tiles: it does not go with --no-normal-mapping")
    if values.get("printed_cone_test"):
        raise UsageError("--max-error counts on the program's own test: it does not go with --cone-test printed")


class _Parser(argparse.ArgumentParser):
    """Answers a bad command line with one line instead of the whole usage."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message} (see {self.prog} --help)")


_CAMERA = ("position", "focal_point", "view_up", "view_angle", "orthographic")

_USAGE = {
    "window": "%(prog)s [MODEL] [options]\n       %(prog)s render [MODEL] --output FILE [options]\n"
    "       %(prog)s info [MODEL] [--json]\n       %(prog)s bench [MODEL ...] [options]\n"
    "       %(prog)s cache [--clear]",
    "render": "%(prog)s [MODEL] --output FILE [options]",
    "info": "%(prog)s [MODEL] [--w-s N] [--json]",
    "cache": "%(prog)s [--clear]",
}

_DESCRIPTION = {
    "window": "Look at a very detailed model in a window. Without MODEL: a procedural meteoroid.",
    "render": "Draw a model without a window.",
    "info": "Say what a file holds and what is built from it.",
    "cache": "Say where the models that have been opened before are kept, and how much that is.",
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
    if command == "cache":
        parser.add_argument("--clear", action="store_true", help="remove all of it")
        return parser
    parser.add_argument("model", metavar="MODEL", nargs="?", default=None, type=Path, help=MODEL_HELP)
    _add_model_options(parser, command)
    if command != "info":
        _add_picture_options(parser)
        _add_goal_options(parser, command)
        _add_camera_options(parser)
        _add_comparison_options(parser)
    if command == "render":
        parser.add_argument(
            "--output", metavar="FILE", dest="outputs", action=_AddOutput, type=option_values.output,
            help="FILE.png: the shaded picture, FILE.npz: its arrays; may be given several times",
        )  # fmt: skip
        parser.add_argument(
            "--frames", metavar="N", type=option_values.whole(1, 1_000_000), help="draw N frames, report medians"
        )
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


def _add_model_options(parser: argparse.ArgumentParser, command: str) -> None:
    group = parser.add_argument_group("model")
    group.add_argument("--points", action="store_true", help="build a point hierarchy from a mesh, too")
    group.add_argument("--texture", metavar="FILE", type=Path, help="colour the surfels by FILE")
    group.add_argument(
        "--w-s",
        metavar="N",
        dest="baked_texels" if command == "info" else "texels",
        type=option_values.texels,
        help="bake the tiles of all nodes, too: N texels a side"
        if command == "info"
        else "most texels along one side of a normal tile (16)",
    )
    group.add_argument(
        "--no-cache", dest="cache", action="store_false", help="build the model anew, and do not keep it"
    )


def _add_picture_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("picture")
    group.add_argument(
        "--r-sil", metavar="PX", type=option_values.radius, help="largest radius of a silhouette surfel (2)"
    )
    group.add_argument(
        "--r-inner", metavar="PX", type=option_values.radius, help="largest radius of any other surfel (16)"
    )
    group.add_argument(
        "--no-normal-mapping", dest="normal_mapping", action="store_false", help="draw without the normal tiles"
    )
    group.add_argument(
        "--tile-memory", metavar="MB", type=option_values.whole(1, 1_000_000),
        help="most graphics memory that the normal tiles may take (134)",
    )  # fmt: skip
    group.add_argument(
        "--resolution", metavar="W,H", type=option_values.resolution, help="size of the picture in pixels"
    )


def _add_goal_options(parser: argparse.ArgumentParser, command: str) -> None:
    group = parser.add_argument_group("goals", "What the radii shall follow from.")
    group.add_argument(
        "--max-error", metavar="DEG[,PX]", type=option_values.max_error,
        help="r_sil, r_inner and w_s for at most so large a mean error of the normals, in degrees, and of the outline, "
        f"in pixels ({option_values.DEFAULT_MAX_PIXELS})",
    )  # fmt: skip
    moving = "as far as that takes" if command == "render" else "while the camera moves"
    group.add_argument(
        "--fps", metavar="N", type=option_values.fps, help=f"draw coarser, {moving}, to hold N frames a second"
    )


def _add_comparison_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("for comparison", "What the papers do.")
    group.add_argument(
        "--splat", choices=SPLATS, help="draw splats as quads in their planes, or as point sprites (quad)"
    )
    group.add_argument(
        "--cone-test", dest="printed_cone_test", action=_IsPrinted, choices=("own", "printed"),
        help="tell the silhouette by this program's own test, or by the one printed in the paper (own)",
    )  # fmt: skip


def _add_camera_options(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("camera", "What is not given is chosen to fit the model.")
    group.add_argument("--camera-position", metavar="X,Y,Z", type=option_values.vector, help="where the eye is")
    group.add_argument("--camera-focal-point", metavar="X,Y,Z", type=option_values.vector, help="what it looks at")
    group.add_argument(
        "--camera-view-up", metavar="X,Y,Z", type=option_values.direction, help="the direction that is up"
    )
    group.add_argument(
        "--camera-view-angle", metavar="DEG", type=option_values.view_angle, help="vertical field of view (45)"
    )
    group.add_argument(
        "--camera-orthographic", action="store_true",
        help="parallel view rays instead of perspective; what is at the focal point stays as large",
    )  # fmt: skip


class _AddOutput(argparse.Action):
    """Collects a tuple, where argparse's own "append" would make a list."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: object, option: str | None = None
    ) -> None:
        setattr(namespace, self.dest, (*getattr(namespace, self.dest, ()), values))


class _IsPrinted(argparse.Action):
    """Stores whether the cone test of the paper was chosen."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: object, option: str | None = None
    ) -> None:
        setattr(namespace, self.dest, values == "printed")


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
