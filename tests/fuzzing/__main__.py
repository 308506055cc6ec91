"""Read damaged files of every family, many of them.

    python -m tests.fuzzing                       # 200,000 files a family
    python -m tests.fuzzing meshes --inputs 5000 --kept runs/fuzz
    python -m tests.fuzzing meshes --atheris      # guided by coverage; needs `pip install atheris`

The last line is JSON; exit code 1 where anything was found. See docs/security.md.
"""

from __future__ import annotations

import argparse
import json
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from tests.fuzzing.running import Outcome, fuzz


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzzing")
    parser.add_argument("family", nargs="*", help="all unless named")
    parser.add_argument("--inputs", type=int, default=200_000, help="files a family")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2, help="families at once")
    parser.add_argument("--kept", type=Path, help="folder for files that failed")
    parser.add_argument("--atheris", action="store_true", help="guided by coverage, one family")
    options = parser.parse_args()
    if options.atheris:
        if len(options.family) != 1:
            parser.error("name one family")
        from tests.fuzzing.guided import run

        run(options.family[0], options.inputs, options.seed)
        return
    # Behind atheris, which watches what is imported after it.
    from tests.fuzzing.families import FAMILIES

    names = options.family or list(FAMILIES)
    if unknown := set(names) - set(FAMILIES):
        parser.error(f"there is no family {', '.join(sorted(unknown))}: choose {', '.join(FAMILIES)}")
    with ProcessPoolExecutor(options.workers) as pool:
        waiting = [
            pool.submit(fuzz, name, FAMILIES[name], options.inputs, options.seed, options.kept)
            for name in names
        ]
        outcomes: list[Outcome] = []
        for one in waiting:
            outcomes.append(one.result())
            sys.stderr.write(json.dumps(outcomes[-1].to_json()) + "\n")
    sys.stdout.write(json.dumps([outcome.to_json() for outcome in outcomes]) + "\n")
    sys.exit(any(outcome.failures for outcome in outcomes))


if __name__ == "__main__":
    main()
