"""All of the evidence in one self-contained HTML file.

Usage::

    python validation/report.py --quick [--data DIR] [--out DIR] [--only PART ...]
    python validation/report.py --full  [--data DIR] [--out DIR] [--only PART ...]

--quick: small versions of the charts, profiles, oracles, the stress test and the
pictures, in less than ten minutes. --full: the same at their sizes, and Maros-Meszaros,
benchmarks, large LCPs and infeasible QPs, which takes hours. Either writes report.html
into the folder --out (report), figures and tables inlined, also when it is interrupted,
beside its CSV files and figures. What goes on where it stopped does so here too;
`--full --out validation` brings the repository's own files up to date.

The parts are commands of their own, each run in a process, one after the other, so that
none disturbs the times of another. One that fails, or whose data are missing, is named
at the top, and the rest goes on. --data (or the environment variable NAMLCP_DATA) is
the folder described in README.md.
"""

import argparse
import base64
import html
import os
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple, TextIO

from benchmark import machine_lines, use_one_thread

HERE = Path(__file__).parent
MISSING = 2  # what a script returns whose data folder lacks something
BAR = 24
STYLE = """
body { font: 15px/1.5 sans-serif; max-width: 72em; margin: 2em auto; padding: 0 1em }
table { border-collapse: collapse; font-size: 13px; margin: 1em 0 }
caption { text-align: left; font-weight: bold }
td, th { border-bottom: 1px solid #ddd; padding: 2px 10px; text-align: left }
svg, img { max-width: 100%; height: auto } pre { font-size: 12px; overflow-x: auto }
.bad { color: #AA3377; font-weight: bold }
"""


class Part(NamedTuple):
    """A title, the commands, the figures they make, seconds that they take about.

    In the commands {data}, {results} and {figures} stand for folders.
    """

    title: str
    commands: tuple[str, ...]
    figures: tuple[str, ...] = ()
    seconds: float = 60.0


class Outcome(NamedTuple):
    """What became of a part: a word of it ("" if all is well), its text, its time."""

    fault: str
    text: str
    seconds: float


FOLDERS = "--results {results}"
QUICK = {
    "work-precision": Part(
        "Speed against accuracy",
        (
            f"work_precision.py run --quick --data {{data}} {FOLDERS}",
            f"work_precision.py plot --quick {FOLDERS} --figures {{figures}}",
        ),
        ("work-precision-quick.svg",),
        200.0,
    ),
    "profiles": Part(
        "Performance profiles",
        (
            f"profiles.py run --quick --data {{data}} {FOLDERS}",
            f"profiles.py plot --quick {FOLDERS} --figures {{figures}}",
        ),
        ("profiles-quick.svg",),
    ),
    "oracles": Part(
        "Agreement with independent oracles",
        ("oracles.py run --quick --data {data} --csv {results}/oracles.csv",),
    ),
    "stress": Part(
        "Stability under stress",
        (
            "stress.py run --quick --csv {results}/stress.csv",
            "stress.py plot --csv {results}/stress.csv --figure {figures}/stress.svg",
        ),
        ("stress.svg",),
    ),
    "pictures": Part(
        "What solutions look like",
        ("pictures.py --quick --figures {figures}",),
        ("contact-sets.png", "exercise-boundary.svg", "contact-forces.svg"),
        20.0,
    ),
}
FULL = {
    "maros-meszaros": Part(
        "The Maros-Meszaros collection",
        (
            "maros_meszaros.py run --data {data} --csv {results}/maros-meszaros.csv",
            "maros_meszaros.py table --data {data} --csv {results}/maros-meszaros.csv",
        ),
        seconds=9000.0,
    ),
    "work-precision": Part(
        "Speed against accuracy",
        (
            f"work_precision.py run --data {{data}} {FOLDERS}",
            f"work_precision.py plot {FOLDERS} --figures {{figures}}",
        ),
        ("work-precision.svg",),
        2700.0,
    ),
    "profiles": Part(
        "Performance profiles",
        (
            f"profiles.py run --data {{data}} {FOLDERS}",
            f"profiles.py plot {FOLDERS} --figures {{figures}}",
        ),
        ("profiles.svg",),
        600.0,
    ),
    "oracles": Part(
        "Agreement with independent oracles",
        ("oracles.py run --data {data} --csv {results}/oracles.csv",),
        seconds=1200.0,
    ),
    "stress": Part(
        "Stability under stress",
        (
            "stress.py run --csv {results}/stress.csv",
            "stress.py plot --csv {results}/stress.csv --figure {figures}/stress.svg",
        ),
        ("stress.svg",),
        1200.0,
    ),
    "pictures": Part(
        "What solutions look like",
        ("pictures.py --figures {figures}",),
        ("contact-sets.png", "exercise-boundary.svg", "contact-forces.svg"),
    ),
    "benchmark": Part(
        "MPC, contact and small QPs",
        (
            "benchmark.py --data {data} --set mpc contact small strict"
            " --csv {results}/benchmark.csv",
        ),
        seconds=900.0,
    ),
    "infeasible": Part(
        "Infeasible and unbounded QPs",
        ("infeasible.py --data {data} --csv {results}/infeasible.csv",),
        seconds=600.0,
    ),
    "generalisation": Part(
        "Problems that nothing was tuned on",
        ("generalisation.py --data {data} --csv {results}/generalisation.csv",),
        seconds=3600.0,
    ),
    "large": Part(
        "Large LCPs",
        (
            f"large.py run {FOLDERS}",
            f"large.py plot {FOLDERS} --figures {{figures}}",
            f"large.py table {FOLDERS}",
        ),
        ("large.svg",),
        3600.0,
    ),
    "lcp": Part("LCPs beside PIQP and OSQP", (f"lcp.py --data {{data}} {FOLDERS}",)),
    "hertz": Part("Hertz contact without a matrix", ("hertz.py",)),
    "put": Part("American puts", (f"american_put.py {FOLDERS}",), seconds=300.0),
    "cvxpy": Part(
        "Models in CVXPY",
        (
            "cvxpy_models.py --csv {results}/cvxpy-models.csv",
            "cvxpy_resolve.py --csv {results}/cvxpy-resolve.csv",
        ),
        seconds=900.0,
    ),
    "paper": Part(
        "The paper's tables",
        (f"paper.py {FOLDERS} --figures {{figures}}",),
        ("paper-tables.svg", "paper-methods.svg"),
        900.0,
    ),
    "stability": Part(
        "Where sweeps fail",
        (f"stability.py {FOLDERS} --figures {{figures}}",),
        ("stability-maps.png", "stability-units.png"),
        900.0,
    ),
    "parameters": Part(
        "Automatic parameters",
        (f"parameters.py --data {{data}} {FOLDERS}",),
        seconds=900.0,
    ),
    "h_plus": Part("Convergence theory", (f"h_plus.py {FOLDERS}",), seconds=900.0),
}


class Progress:
    """One line: a bar by expected seconds, the part, and the last line it printed."""

    def __init__(self, parts: dict[str, Part], stream: TextIO) -> None:
        self.parts, self.stream = parts, stream
        self.total = sum(part.seconds for part in parts.values())
        self.done = 0.0
        self.start = self.began = time.monotonic()

    def show(self, name: str, line: str) -> None:
        """Draw the line anew; the part under way never fills its share."""
        expected = self.parts[name].seconds
        share = min((time.monotonic() - self.began) / expected, 0.95) * expected
        filled = int(BAR * (self.done + share) / self.total)
        bar = "#" * filled + "." * (BAR - filled)
        minutes, seconds = divmod(int(time.monotonic() - self.start), 60)
        text = f"[{bar}] {minutes:3d}:{seconds:02d} {name}: {' '.join(line.split())}"
        self.stream.write(f"\r{text[:78]:<78}")
        self.stream.flush()

    def finish(self, name: str, word: str) -> None:
        """Count a part as done and leave a line about it."""
        self.done += self.parts[name].seconds
        seconds = time.monotonic() - self.began
        self.stream.write(f"\r{name}: {word or 'done'}, {seconds:.0f} s".ljust(79))
        self.stream.write("\n")
        self.began = time.monotonic()


def run_part(name: str, part: Part, folders: dict[str, Path], bar: Progress) -> Outcome:
    """Run the commands of a part as far as they go."""
    start = time.monotonic()
    lines: list[str] = []
    fault = ""
    for command in part.commands:
        script, *arguments = [word.format(**folders) for word in command.split()]
        if not (HERE / script).exists():
            fault = f"{script} is not there"
            break
        code = run_command([str(HERE / script), *arguments], lines, name, bar)
        if code == MISSING:
            fault = "something is missing, see its text"
        elif code != 0:
            fault = f"{script} ended with {code}, see its text"
        if code not in (0, MISSING):
            break
    return Outcome(fault, "".join(lines), time.monotonic() - start)


def run_command(command: list[str], lines: list[str], name: str, bar: Progress) -> int:
    """Run one script, keep its lines, show the last one; return its exit code."""
    with subprocess.Popen(
        [sys.executable, "-u", *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            lines.append(line)
            bar.show(name, line)
    return process.returncode


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
        cells = [html.escape(cell.strip()) for cell in line.strip(" |").split("|")]
        rows.append("".join(f"<{tag}>{cell}</{tag}>" for cell in cells))
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    return f"<table><caption>{html.escape(title)}</caption>{body}</table>"


def write_html(
    file: Path,
    parts: dict[str, Part],
    outcomes: dict[str, Outcome],
    figures: Path,
    header: Iterable[str],
) -> None:
    """Write the report of the parts that have an outcome; name those that have not."""
    pieces = [f"<!doctype html><meta charset=utf-8><title>namlcp</title><style>{STYLE}"]
    pieces.append("</style><h1>namlcp: the evidence</h1><p>")
    pieces.append("<br>".join(html.escape(line) for line in header) + "</p><ul>")
    for name, part in parts.items():
        outcome = outcomes.get(name)
        word = "not run" if outcome is None else outcome.fault
        seconds = "" if outcome is None else f", {outcome.seconds:.0f} s"
        mark = f' <span class="bad">{html.escape(word)}</span>' if word else ""
        pieces.append(f'<li><a href="#{name}">{part.title}</a>{seconds}{mark}</li>')
    pieces.append("</ul>")
    for name, outcome in outcomes.items():
        pieces.append(f'<h2 id="{name}">{parts[name].title}</h2>')
        if outcome.fault:
            pieces.append(f'<p class="bad">{html.escape(outcome.fault)}</p>')
        pieces += [inline(figures / figure) for figure in parts[name].figures]
        pieces.append(body_of(outcome.text))
    file.write_text("\n".join(pieces))


def report(
    parts: dict[str, Part], folders: dict[str, Path], out: Path, stream: TextIO
) -> dict[str, Outcome]:
    """Run the parts, with a bar on `stream`; write report.html, also on Ctrl-C."""
    outcomes: dict[str, Outcome] = {}
    bar = Progress(parts, stream)
    header = machine_lines(["nam"])
    if not folders["data"].exists():
        header.append(f"the data folder {folders['data']} is missing: see README.md")
    out.mkdir(parents=True, exist_ok=True)
    try:
        for name, part in parts.items():
            outcomes[name] = run_part(name, part, folders, bar)
            bar.finish(name, outcomes[name].fault)
    finally:
        write_html(out / "report.html", parts, outcomes, folders["figures"], header)
    return outcomes


def main(arguments: list[str] | None = None) -> int:
    """Run all parts; return 1 if one of them failed, missing data apart."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    size = parser.add_mutually_exclusive_group(required=True)
    size.add_argument("--quick", action="store_true", help="under ten minutes")
    size.add_argument("--full", action="store_true", help="hours")
    default = Path(os.environ.get("NAMLCP_DATA", "data"))
    parser.add_argument("--data", type=Path, default=default, help="the data folder")
    parser.add_argument("--out", type=Path, default=Path("report"))
    parser.add_argument("--only", nargs="+", choices=list(FULL), metavar="PART")
    args = parser.parse_args(arguments)
    use_one_thread()
    parts = QUICK if args.quick else FULL
    if args.only:
        parts = {name: part for name, part in parts.items() if name in args.only}
    own = args.out.resolve()
    folders = {
        "data": args.data.resolve(),
        "results": own / "results",
        "figures": own / "figures",
    }
    for folder in ("results", "figures"):
        folders[folder].mkdir(parents=True, exist_ok=True)
    outcomes = report(parts, folders, args.out, sys.stderr)
    print(f"{args.out / 'report.html'}")
    failed = [name for name, outcome in outcomes.items() if outcome.fault]
    for name in failed:
        print(f"{name}: {outcomes[name].fault}")
    return int(any("missing" not in outcomes[name].fault for name in failed))


if __name__ == "__main__":
    sys.exit(main())
