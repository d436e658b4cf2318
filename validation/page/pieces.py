"""Pieces of an HTML page: figures and tables inlined, printed text folded away."""

import base64
import html
from pathlib import Path

STYLE = """
body { font: 15px/1.5 sans-serif; max-width: 72em; margin: 2em auto; padding: 0 1em }
table { border-collapse: collapse; font-size: 13px; margin: 1em 0 }
caption { text-align: left; font-weight: bold }
td, th { border-bottom: 1px solid #ddd; padding: 2px 10px; text-align: left }
svg, img { max-width: 100%; height: auto } pre { font-size: 12px; overflow-x: auto }
.bad { color: #AA3377; font-weight: bold }
"""


def inline(file: Path) -> str:
    """Return a figure as HTML that needs no other file."""
    if not file.exists():
        return f'<p class="bad">{html.escape(file.name)} was not drawn.</p>'
    if file.suffix == ".svg":
        text = file.read_text()
        return text[text.index("<svg") :]
    code = base64.b64encode(file.read_bytes()).decode()
    return f'<img alt="{html.escape(file.stem)}" src="data:image/png;base64,{code}">'


def body_of(text: str) -> str:
    """Return printed text as HTML: Markdown tables as tables, the rest folded away."""
    shown: list[str] = []
    rest: list[str] = []
    lines: list[str] = []
    for line in [*text.splitlines(), ""]:
        if line.startswith("|"):
            lines.append(line)
            continue
        if lines:
            title = next((other for other in reversed(rest) if other), "")
            shown.append(table(title, lines))
            lines = []
        rest.append(line)
    folded = html.escape("\n".join(rest).strip())
    if folded:
        summary = "<details><summary>what it printed</summary>"
        shown.append(f"{summary}<pre>{folded}</pre></details>")
    return "\n".join(shown)


def table(title: str, lines: list[str]) -> str:
    """Return a Markdown table as an HTML table."""
    rows = []
    for number, line in enumerate(lines):
        if set(line.strip()) <= set("|-: "):
            continue
        tag = "td" if number else "th"
        cells = [html.escape(cell.strip()) for cell in line.strip()[1:-1].split("|")]
        bad = ' class="bad"' if cells[-1] == "FELL" else ""
        text = "".join(f"<{tag}>{cell}</{tag}>" for cell in cells)
        rows.append(f"<tr{bad}>{text}</tr>")
    body = "".join(rows)
    return f"<table><caption>{html.escape(title)}</caption>{body}</table>"
