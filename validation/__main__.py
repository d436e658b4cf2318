"""Run a script: `python -m validation ROOM.SCRIPT [SUITE] [run|plot] ...`.

SUITE names one of several suites of a script; --help says what a script does, and
`report.JOBS` which of them makes which file.
"""

import importlib
import sys


def main(arguments: list[str] | None = None) -> int:
    given = sys.argv[1:] if arguments is None else arguments
    if not given or given[0] in ("-h", "--help"):
        print(__doc__)
        return 0
    script, *rest = given
    module = importlib.import_module(f"validation.{script}")
    if hasattr(module, "SUITES"):
        name, *rest = rest or [""]
        if name not in module.SUITES:
            print(f"{module.__doc__}\nsuites: {', '.join(module.SUITES)}")
            return int(name not in ("", "-h", "--help"))
        return module.SUITES[name].main(rest)
    return getattr(module, "SUITE", module).main(rest)


if __name__ == "__main__":
    sys.exit(main())
