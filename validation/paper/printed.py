"""Tables 1 and 2 of the paper, as printed: delta = 4, from s0 = (1, 0, 1, 0, ...)."""

EPS = 1e-5
"""Res at which a run ends."""

SIZES = (10, 30, 50, 60, 80, 100)
"""m, with n = m^2."""

PRINTED = """
1 mgs    -    | 36 40 41 41 42 42 | 97 80 79 89 74 84 | .0039 .0293 .2699 .6400 2.0785 4.5712
1 namgs  -    | 16 17 17 17 18 18 | 63 63 85 95 45 51 | .0024 .0146 .1089 .2688 .8179 2.0175
1 msor   0.85 | 15 17 18 18 18 19 | 95 76 53 65 89 43 | .0034 .0141 .1201 .2903 .7826 2.0791
1 namsor 0.91 | 12 12 13 13 13 13 | 27 76 32 37 48 59 | .0028 .0116 .0905 .2017 .6467 2.1918
2 mgs    -    | 24 26 26 26 27 27 | 90 65 87 96 65 73 | .0034 .0208 .1707 .3961 1.1542 2.9471
2 namgs  -    | 12 12 13 13 13 13 | 38 84 31 35 44 53 | .0026 .0141 .0837 .1998 .2987 1.4461
2 msor   0.88 | 14 14 15 15 15 15 | 38 82 41 46 55 63 | .0029 .0123 .1040 .2505 .6543 1.6363
2 namsor 0.88 |  8  9  9  9  9  9 | 22 15 27 37 46 59 | .0022 .0096 .0655 .1409 .0441 1.7340
"""  # noqa: E501
"""example, method, alpha | IT | Res in units of 1e-7 | CPU [s]; misprints included."""

Key = tuple[int, str, float | None]
TABLES: dict[Key, tuple[tuple[float, ...], ...]] = {}
for line in PRINTED.strip().splitlines():
    key, counts, *columns = line.split("|")
    example, method, alpha = key.split()
    entries = [tuple(map(float, column.split())) for column in columns]
    name = int(example), method, None if alpha == "-" else float(alpha)
    TABLES[name] = (tuple(map(int, counts.split())), *entries)
