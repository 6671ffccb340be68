"""A setting in words, as tables and plots print it."""

from __future__ import annotations

from benchmarks.methods import METHODS
from benchmarks.run_file import Setting


def describe(setting: Setting) -> str:
    """Return model, view and method, and of the radii and texels those that mean something to the method."""
    return f"{setting.model}, {setting.view}: {setting.method}{numbers(setting)}"


def numbers(setting: Setting) -> str:
    """Return what follows the method: ", r_sil 2, r_inner 16, w_s 16"."""
    method = METHODS.get(setting.method)
    words = f", r_sil {setting.r_sil:g}, r_inner {setting.r_inner:g}" if method is None or method.radii else ""
    return words + (f", w_s {setting.w_s}" if setting.w_s else "")


def count(number: float) -> str:
    """Return a number in few characters: 0.25, 270 k, 17 M."""
    for unit, name in ((1e6, "M"), (1e3, "k")):
        if number >= 0.9995 * unit:
            return f"{number / unit:.3g} {name}"
    return f"{number:.3g}"
