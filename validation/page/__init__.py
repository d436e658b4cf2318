"""The report: its parts, and its HTML page with figures and tables inlined."""

from validation.page.parts import FULL, QUICK, Part
from validation.page.pieces import STYLE, body_of, inline, table
