"""Compile the shaders: files from the shaders room, with includes expanded and switches defined."""

from __future__ import annotations

import functools
import importlib.resources
import re
from collections.abc import Mapping

import moderngl

GLSL_VERSION = 330
_INCLUDE = re.compile(r'^#include "([\w/.]+)"$', re.MULTILINE)


@functools.cache
def shader_source(name: str) -> str:
    """Return the text of a shader file with its includes in place.

    Raises FileNotFoundError where there is no such file.
    """
    text = importlib.resources.files("shaders").joinpath(name).read_text(encoding="utf-8")
    return _INCLUDE.sub(lambda match: shader_source(f"include/{match[1]}"), text)


def make_program(
    ctx: moderngl.Context, vertex: str, fragment: str, defines: Mapping[str, str | int | float] | None = None
) -> moderngl.Program:
    """Compile and link two shader files.

    vertex, fragment : file names in the shaders room
    defines : names and values that both see as preprocessor macros
    """
    header = f"#version {GLSL_VERSION} core\n"
    header += "".join(f"#define {name} {value}\n" for name, value in (defines or {}).items())
    return ctx.program(header + shader_source(vertex), header + shader_source(fragment))


class Uniforms:
    """The uniforms of a program, which are told only what they do not hold already."""

    # moderngl looks for a name by going through all of a program's members: 0.4 ms a frame.
    def __init__(self, program: moderngl.Program) -> None:
        members = {name: program[name] for name in program}
        self._uniforms = {name: member for name, member in members.items() if isinstance(member, moderngl.Uniform)}
        self._held: dict[str, object] = {}

    def set(self, values: Mapping[str, object]) -> None:
        """Set those of the values that the program uses; what it uses and is not among them stays."""
        for name, uniform in self._uniforms.items():
            if name in values and (name not in self._held or self._held[name] != values[name]):
                uniform.value = values[name]
                self._held[name] = values[name]
