"""The figures of LCPs: general ones, time steps, large ones, American puts, Hertz."""

import itertools
import math
from collections.abc import Iterable

from validation.claims.ratios import Figures, least, mean, most, numbers
from validation.harness import Row, csv_files, tables

FRICTION = ("pile", "wall", "chain", "balls", "cubes")
COPOSITIVE = ("copositive", "singular copositive", "copositive-plus", "P0")
DENSE = 600  # size up to which the solvers for dense matrices are asked
WITHIN_WALLS = ("wall", "chain", "cubes")
OBSTACLES = (
    "ball", "torsion", "biactive", "rough", "anisotropic", "3-D", "mesh, jumps"
)  # fmt: skip
PEERS = ("osqp", "piqp", "clarabel")
SPEED_UP = "90000"  # unknowns of the forced obstacle that the peers solve too
MILLION = "1000000"
NEARLY = 900_000  # unknowns of a scene of about a million
PILES_FROM = 5000  # unknowns beyond which the growth of time with n is looked at


def of_families(rows: Iterable[Row], families: Iterable[str]) -> list[Row]:
    """Return the rows of these families."""
    return [row for row in rows if row["family"] in families]


def successes(rows: Iterable[Row]) -> list[Row]:
    """Return the rows with success."""
    return tables.chosen(rows, success="True")


def of_general(rows: list[Row]) -> Figures:
    """Return who solves the general LCPs, and how long namlcp takes."""
    friction = of_families(rows, FRICTION)
    small = [row for row in friction if int(row["n"]) <= DENSE]
    large = [row for row in friction if int(row["n"]) > DENSE]
    groups = {
        "friction": small,
        "large friction": large,
        "games": of_families(rows, ("games",)),
        "copositive": of_families(rows, COPOSITIVE),
    }
    found: Figures = {}
    for group, members in groups.items():
        for solver in tables.distinct(members, "solver"):
            own = tables.chosen(members, solver=solver)
            found[f"{group} LCPs asked of {solver}"] = len(own)
            found[f"{group} LCPs solved by {solver}"] = len(successes(own))
    found["friction LCPs, largest n"] = most(numbers(small, "order"))
    ours = tables.chosen(rows, solver="nam")
    by_us, by_any = (
        {(row["family"], row["n"], row["seed"]) for row in successes(some)}
        for some in (ours, rows)
    )
    found["general LCPs that others alone solve"] = len(by_any - by_us)
    found |= of_games(tables.chosen(ours, family="games"))
    return found | of_large_friction(tables.chosen(large, solver="nam"))


def of_games(ours: list[Row]) -> Figures:
    """Return the mean times of the quickest and the slowest size of games [ms]."""
    means = [
        1e3 * mean(numbers(successes(tables.chosen(ours, n=n)), "runtime"))
        for n in tables.distinct(ours, "n")
    ]
    return {"games, least ms": least(means), "games, most ms": most(means)}


def of_large_friction(ours: list[Row]) -> Figures:
    """Return what is solved of the largest problems with friction, and the seconds."""
    largest = max((int(row["n"]) for row in ours), default=0)
    ours = tables.chosen(ours, n=str(largest))
    held = numbers(successes(of_families(ours, WITHIN_WALLS)), "runtime")
    found = {"walls, least seconds": least(held), "walls, most seconds": most(held)}
    for family in FRICTION:
        own = tables.chosen(ours, family=family)
        seconds = numbers(successes(own), "runtime")
        found[f"large {family}, asked"] = len(own)
        found[f"large {family}, solved"] = len(seconds)
        found[f"large {family}, n"] = most(numbers(own, "order"))
        found[f"large {family}, most seconds"] = most(seconds)
    return found


def of_stepping(rows: list[Row]) -> Figures:
    """Return the worst of all steps of falling discs, and the mean times of runs."""
    found: Figures = {
        "steps": len(rows),
        "steps solved": len(tables.chosen(rows, status="solved")),
        "steps, deepest overlap": most(numbers(rows, "overlap")),
    }
    gained: list[float] = []
    for start, name in (("last step", "warm"), ("nothing", "cold")):
        means = []
        for discs in tables.distinct(tables.chosen(rows, start=start), "discs"):
            own = tables.chosen(rows, discs=discs, start=start)
            energy, seconds = numbers(own, "energy"), numbers(own, "seconds")
            gained += [b - a for a, b in itertools.pairwise(energy)]
            means.append(1e3 * sum(seconds) / len(own))
        found[f"steps, {name}, least ms"] = least(means)
        found[f"steps, {name}, most ms"] = most(means)
    found["steps, most energy gained"] = max(0.0, most(gained))
    return found


def of_large(rows: list[Row]) -> Figures:
    """Return the figures of large obstacles, their memory, contact piles and a put."""
    rows = [row for row in rows if row["seconds"]]
    ours = tables.chosen(rows, solver="nam", status="solved")
    forced = tables.chosen(ours, scene="forced", method="multigrid")
    cycles = numbers(forced, "iterations")
    found = {
        "forced obstacle, least cycles": least(cycles),
        "forced obstacle, most cycles": most(cycles),
    }
    for row in forced:
        ratio = csv_files.number(row["ratio"])
        found[f"forced obstacle, linear solves at {row['n']}"] = ratio
    found |= of_obstacles(ours)
    million = [
        r for r in tables.chosen(ours, method="multigrid") if int(r["n"]) >= NEARLY
    ]
    ratios = numbers(million, "ratio")
    found["large scenes"] = len(ratios)
    found["large over one linear solve, least"] = least(ratios)
    found["large over one linear solve, worst"] = most(ratios)
    cycles = numbers(tables.chosen(ours, scene="transport"), "iterations")
    found["Example 2, least cycles"] = least(cycles)
    found["Example 2, most cycles"] = most(cycles)
    for method in ("multigrid", "psor"):
        memory = numbers(tables.chosen(ours, method=method), "memory")
        found[f"memory of {method}, least"] = least(memory)
        found[f"memory of {method}, most"] = most(memory)
    found |= of_speed_up(tables.chosen(rows, scene="forced", n=SPEED_UP))
    found |= of_piles(ours)
    # the method of a put is its error
    puts = tables.chosen(rows, solver="nam", scene="put", n="4000")
    found["put over Brennan and Schwartz, a step"] = most(numbers(puts, "ratio"))
    return found


def of_obstacles(ours: list[Row]) -> Figures:
    """Return the figures of obstacles with a million unknowns, but the forced one."""
    million = [
        row for row in tables.chosen(ours, n=MILLION) if row["scene"] in OBSTACLES
    ]
    cycles, ratios = numbers(million, "iterations"), numbers(million, "ratio")
    return {
        "obstacles solved": len(million),
        "obstacles, least cycles": least(cycles),
        "obstacles, most cycles": most(cycles),
        "obstacles, least linear solves": least(ratios),
        "obstacles, most linear solves": most(ratios),
    }


def of_speed_up(rows: list[Row]) -> Figures:
    """Return the times [s] of one forced obstacle, and the fastest peer's over ours."""
    done = tables.chosen(rows, status="solved")
    seconds = {row["solver"]: float(row["seconds"]) for row in done}
    found = {f"forced obstacle by {name}": time for name, time in seconds.items()}
    fastest = min(seconds.get(peer, math.inf) for peer in PEERS)
    if "nam" in seconds and math.isfinite(fastest):
        found["forced obstacle, fastest peer over nam"] = fastest / seconds["nam"]
    return found


def of_piles(ours: list[Row]) -> Figures:
    """Return the power of n with which the time of contact piles grows, at the end."""
    found: Figures = {}
    for scene in ("heap", "heap, wide", "wall"):
        own = tables.chosen(ours, scene=scene)
        points = sorted((int(row["n"]), float(row["seconds"])) for row in own)
        for (n, time), (large_n, large_time) in itertools.pairwise(points):
            if n > PILES_FROM:
                power = math.log(large_time / time) / math.log(large_n / n)
                found[f"{scene}, exponent"] = power
        if own:
            last = max(own, key=lambda row: int(row["n"]))
            found[f"{scene}, factorisations"] = csv_files.number(last["iterations"])
            found[f"{scene}, seconds"] = float(last["seconds"])
    return found


def of_puts(rows: list[Row]) -> Figures:
    """Return the errors of American puts, and their time over Brennan and Schwartz."""
    errors = [abs(error) for error in numbers(rows, "error")]
    ratios = numbers(rows, "ratio")
    return {
        "puts, least error": least(errors),
        "puts, most error": most(errors),
        "puts over Brennan and Schwartz, least": least(ratios),
        "puts over Brennan and Schwartz, most": most(ratios),
    }


def of_hertz(rows: list[Row]) -> Figures:
    """Return the errors on the finest grid, and its products."""
    last = max(rows, key=lambda row: int(row["n"]))
    found = {"hertz, products": csv_files.number(last["products"])}
    for part in ("radius", "force", "pressure"):
        found[f"hertz, {part}"] = abs(csv_files.number(last[f"{part}_error"]))
    return found


def of_example_one(rows: list[Row]) -> Figures:
    """Return the times of Example 1, OSQP's over ours, the residual and the memory."""
    by_name = {row["solver"]: row for row in rows}
    found: Figures = {}
    for solver, row in by_name.items():
        found[f"example 1, seconds of {solver}"] = csv_files.number(row["runtime"])
        found[f"example 1, memory of {solver}"] = csv_files.number(row["memory"])
    times = [found.get(f"example 1, seconds of {s}", math.nan) for s in ("osqp", "nam")]
    found["example 1, osqp over nam"] = times[0] / times[1]
    if "nam" in by_name:
        found["example 1, residual"] = csv_files.number(by_name["nam"]["residual"])
    return found


FILES = {
    "general-lcps": of_general,
    "time-stepping": of_stepping,
    "large": of_large,
    "american-put": of_puts,
    "hertz": of_hertz,
    "example1": of_example_one,
}
