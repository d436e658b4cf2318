"""The HTML page of the report: figures and tables inlined."""

from validation.page.pieces import STYLE, body_of, inline, table
