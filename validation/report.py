"""All of the evidence in one self-contained HTML file.

--quick: small versions of the charts and oracles, in less than ten minutes. --full: the
same at their sizes, and Maros-Meszaros, benchmarks, large LCPs and infeasible QPs,
which takes hours. Either writes report.html
into the folder --out (report), figures and tables inlined, also when it is ended early,
beside its CSV files and figures. `--full --out validation` brings the repository's own
files up to date, and the figures and tables of its two README files
(`page.documents`). Stopped and run again, it goes on with the commands that are not
done with the present sources (`done.json`; --again begins anew), the long ones within
their CSV files. Of an older run the rows of peers are kept that ran into the time
limit, on the same processor and with the same version (`processes.keep_peers`). At
the top stands what became of each claim (`claims`) since the run before; what fell is
marked. --list runs nothing and tells how long each part takes.

--full compiles all kernels first. It times nothing while other processes keep more than
0.3 of a core busy: it says so and waits, an hour at most (`harness.quiet`). With --busy
one other process may keep a core busy; the headers of the CSV files then say that it
ran beside another.

The parts are commands of their own, each run in a process, one after the other, so that
none disturbs the times of another. One that fails, or whose data are missing, is named
at the top, and the rest goes on. --data (or the environment variable NAMLCP_DATA) is
the folder described in README.md.
"""

import functools
import hashlib
import html
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple, TextIO

if not __package__:  # run as a script
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from validation.claims import Claim, claims, moved
from validation.harness import cli, processes, quiet, tables
from validation.page import FULL, QUICK, STYLE, Part, body_of, inline, table

BAR = 24  # characters
LOWER_ROOMS = ("harness", "problems", "applications", "derivatives")
"""Rooms that the scripts of others import."""


class Outcome(NamedTuple):
    """What became of a part: a word of it ("" if all is well), its text, its time."""

    fault: str
    text: str
    seconds: float


class Done:
    """The commands that the run under way has done, in a file: a stopped one goes on.

    A command is done while the sources that it depends on are the same. `before` are
    the claims when the run began; other sources of the package begin a new run.
    """

    def __init__(self, file: Path, results: Path, again: bool) -> None:
        self.file = file
        sources.cache_clear()  # those at the start of this run count
        kept = json.loads(file.read_text()) if file.exists() and not again else {}
        if kept.get("package") != sources("src"):
            now = [list(claim) for claim in claims(results)]
            kept = {"package": sources("src"), "before": now, "grown": {}, "done": {}}
        self.kept = kept
        self.before = [Claim(*claim) for claim in kept["before"]]

    def begin(self, part: Part, results: Path) -> None:
        """Clear the files with which the commands go on, unless this run began them."""
        for file in part.grown:
            mark = sources(*folders_of(part.commands[0]))
            if self.kept["grown"].get(file) != mark:
                processes.keep_peers(results / file, part.settled)
                self.kept["grown"][file] = mark
        self.file.write_text(json.dumps(self.kept))

    def said(self, command: str) -> tuple[str, float] | None:
        """Return what a command has printed and its seconds, if it is done."""
        mark, *found = self.kept["done"].get(command, [""])
        return tuple(found) if mark == sources(*folders_of(command)) else None

    def note(self, command: str, text: str, seconds: float) -> None:
        """Keep what a command has printed; it is done."""
        mark = sources(*folders_of(command))
        self.kept["done"][command] = [mark, text, seconds]
        self.file.write_text(json.dumps(self.kept))


def folders_of(command: str) -> list[str]:
    """Return what a command depends on: the package, its room and those below."""
    room = command.split(".")[0].split()[0]
    return ["src", *(f"validation/{name}" for name in (*LOWER_ROOMS, room))]


@functools.cache
def sources(*folders: str) -> str:
    """Return a hash of the Python files of folders, or of single modules."""
    found = hashlib.sha256()
    for folder in folders:
        place = cli.ROOT / folder
        for path in sorted(
            [*place.rglob("*.py"), *place.parent.glob(f"{place.name}.py")]
        ):
            found.update(path.read_bytes())
    return found.hexdigest()


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


def run_part(
    name: str, part: Part, folders: dict[str, Path], bar: Progress, done: Done
) -> Outcome:
    """Run the commands of a part that are not done, as far as they go."""
    done.begin(part, folders["results"])
    texts, fault, total = [], "", 0.0
    for words in part.commands:
        known = done.said(words)
        if known is not None:
            texts.append(known[0])
            total += known[1]
            continue
        script, *arguments = [word.format(**folders) for word in words.split()]
        if not (cli.ROOT / "validation" / f"{script.replace('.', '/')}.py").exists():
            fault = f"{script} is not there"
            break
        quiet.wait_until_quiet()
        start, lines = time.monotonic(), []
        command = cli.script(script, *arguments)
        code = run_command(command, lines, lambda line: bar.show(name, line))
        texts.append("".join(lines))
        seconds = time.monotonic() - start
        total += seconds
        if code == 0:
            done.note(words, texts[-1], seconds)
        elif code == cli.MISSING:
            fault = "something is missing, see its text"
        else:
            fault = f"{script} ended with {code}, see its text"
            break
    return Outcome(fault, "".join(texts), total)


def run_command(
    command: list[str], lines: list[str], show: Callable[[str], None]
) -> int:
    """Run a command in the folder ROOT; keep and show its lines; return its code."""
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    with subprocess.Popen(
        command, cwd=cli.ROOT, errors="replace", **streams
    ) as process:
        assert process.stdout is not None
        try:
            for line in process.stdout:
                lines.append(line)
                show(line)
        except KeyboardInterrupt:
            process.terminate()  # it would go on alone
            raise
    return process.returncode


def write_html(
    file: Path,
    parts: dict[str, Part],
    outcomes: dict[str, Outcome],
    figures: Path,
    header: Iterable[str],
    summary: str,
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
    pieces.append(table("Claims, and what has moved", summary.splitlines()))
    for name, outcome in outcomes.items():
        pieces.append(f'<h2 id="{name}">{parts[name].title}</h2>')
        if outcome.fault:
            pieces.append(f'<p class="bad">{html.escape(outcome.fault)}</p>')
        pieces += [inline(figures / figure) for figure in parts[name].figures]
        pieces.append(body_of(outcome.text))
    file.write_text("\n".join(pieces))


def report(
    parts: dict[str, Part],
    folders: dict[str, Path],
    out: Path,
    stream: TextIO,
    again: bool = False,
) -> dict[str, Outcome]:
    """Run the parts, with a bar on `stream`; write report.html, also on Ctrl-C."""
    outcomes: dict[str, Outcome] = {}
    bar = Progress(parts, stream)
    header = cli.begin(["nam"])
    if not folders["data"].exists():
        header.append(f"the data folder {folders['data']} is missing: see README.md")
    out.mkdir(parents=True, exist_ok=True)
    done = Done(out / "done.json", folders["results"], again)
    try:
        for name, part in parts.items():
            known = all(done.said(command) for command in part.commands)
            outcomes[name] = run_part(name, part, folders, bar, done)
            bar.finish(name, outcomes[name].fault or ("done before" if known else ""))
    finally:
        summary = moved(done.before, claims(folders["results"]))
        page, figures = out / "report.html", folders["figures"]
        write_html(page, parts, outcomes, figures, header, summary)
    return outcomes


def minutes(parts: dict[str, Part], out: Path) -> str:
    """Return a table of what the parts take, as measured by the last run or about."""
    file = out / "done.json"
    known = json.loads(file.read_text())["done"] if file.exists() else {}
    lines, total = [], 0.0
    for name, part in parts.items():
        word, seconds = "about", part.seconds
        if all(command in known for command in part.commands):
            word, seconds = "measured", sum(known[c][-1] for c in part.commands)
        total += seconds
        each, until = f"{seconds / 60.0:.0f}", f"{total / 60.0:.0f}"
        lines.append((name, part.title, each, until, word))
    return tables.markdown(("part", "what", "minutes", "until then", ""), lines)


def main(arguments: list[str] | None = None) -> int:
    """Run all parts; return 1 if one of them failed, missing data apart."""
    default = Path(os.environ.get("NAMLCP_DATA", "data"))
    parser = cli.parser(__doc__, data=default)
    size = parser.add_mutually_exclusive_group(required=True)
    size.add_argument("--quick", action="store_true", help="under ten minutes")
    size.add_argument("--full", action="store_true", help="hours")
    parser.add_argument("--out", type=Path, default=Path("report"))
    parser.add_argument("--only", nargs="+", choices=list(FULL), metavar="PART")
    parser.add_argument("--again", action="store_true", help="begin a new run")
    parser.add_argument("--list", action="store_true", help="the parts and minutes")
    help_ = "beside one other process; CSV headers say so"
    parser.add_argument("--busy", action="store_true", help=help_)
    args = parser.parse_args(arguments)
    parts = QUICK if args.quick else FULL
    if args.only:
        parts = {name: part for name, part in parts.items() if name in args.only}
    if args.list:
        print(minutes(parts, args.out))
        return 0
    own = args.out.resolve()
    folders = {
        "data": args.data.resolve(),
        "results": own / "results",
        "figures": own / "figures",
    }
    for folder in ("results", "figures"):
        folders[folder].mkdir(parents=True, exist_ok=True)
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # write the report, too
    if args.full:
        os.environ[quiet.LOAD] = quiet.BESIDE if args.busy else quiet.QUIET
    outcomes = report(parts, folders, args.out, sys.stderr, args.again)
    if args.full and own == cli.ROOT / "validation":
        from validation.page import documents  # needs what all parts need

        documents.write()
    print(f"{args.out / 'report.html'}")
    failed = [name for name, outcome in outcomes.items() if outcome.fault]
    for name in failed:
        print(f"{name}: {outcomes[name].fault}")
    return int(any("missing" not in outcomes[name].fault for name in failed))


if __name__ == "__main__":
    sys.exit(main())
