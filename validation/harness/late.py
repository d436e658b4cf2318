"""What ran into its time limit: not asked again by a later run on the same machine."""

from pathlib import Path

from validation.harness import csv_files, machine, tables

LATE = {"timeout", "too slow"}  # what a row says that ran into the time limit
OURS = ("nam", "sweep")  # first words of what is measured anew in every run
KEPT = "kept of an earlier run: what peers of these versions missed by the time limit"


def keep_late_peers(file: Path) -> None:
    """Clear a file that another run has left, but for peers that were late.

    Their rows do not depend on our code, and to ask again is much of a run's time. It
    is done where the processor or the version of the peer is another one.
    """
    rows = csv_files.read(file)
    solvers = tables.distinct(rows, "solver") if rows and "solver" in rows[0] else []
    header = machine.lines(solvers)
    now, then = said(header), said(csv_files.header(file) if rows else [])
    same = {
        solver
        for solver in solvers
        if (word := solver.split()[0]) not in OURS
        for package in [machine.PACKAGES.get(word, word)]
        if all(now[name] == then.get(name) for name in ("cpu", package))
    }
    late = [r for r in rows if r.get("status") in LATE and r["solver"] in same]
    file.unlink(missing_ok=True)
    if late:
        csv_files.write(file, [*header, KEPT], late)


def said(header: list[str]) -> dict[str, str]:
    """Return the processor ("cpu") and the version of each package in a header."""
    lines = dict(line.split(": ", 1) for line in header if ": " in line)
    packages = lines.get("versions", "").split(", ")
    known = dict(entry.rsplit(" ", 1) for entry in packages if " " in entry)
    return known | {"cpu": lines.get("cpu", "")}
