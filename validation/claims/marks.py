"""Marked figures in a text: what a document says, and what was measured.

A figure that claims something is followed by the name of a value as a comment,
``0.78<!-- Maros-Meszaros over piqp -->``; it has to be the value, rounded to the digits
that the text gives. ``3e-9`` and ``3.1e-10`` are rounded to theirs.
"""

import math
import re

MARK = re.compile(r"(\d[\d.]*(?:e-?\d+)?)<!-- ([^:]+?) -->")


def rounded(value: float, like: str) -> str:
    """Return a value with the digits of a figure."""
    mantissa, e, _ = like.partition("e")
    digits = len(mantissa.partition(".")[2])
    if not e:
        return f"{value:.{digits}f}"
    mantissa, _, exponent = f"{value:.{digits}e}".partition("e")
    return f"{mantissa}e{int(exponent)}"


def stale(text: str, known: dict[str, float]) -> list[str]:
    """Return the marked figures of a text that are not the measured ones."""
    faults = []
    for figure, name in MARK.findall(text):
        value = known.get(name, math.nan)
        if math.isnan(value):
            faults.append(f"{name}: {figure}, not measured")
        elif rounded(value, figure) != figure:
            faults.append(f"{name}: {figure}, measured {value:g}")
    return faults


def renewed(text: str, known: dict[str, float]) -> str:
    """Return a text with the measured figures; what is not measured stays."""

    def measured(mark: re.Match[str]) -> str:
        figure, name = mark.groups()
        value = known.get(name, math.nan)
        new = figure if math.isnan(value) else rounded(value, figure)
        return f"{new}<!-- {name} -->"

    return MARK.sub(measured, text)
