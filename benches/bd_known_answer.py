#!/usr/bin/env python3
"""The Bjøntegaard deltas of `ntmu curve bd` beside those of PyPI's bjontegaard.

    python3 benches/bd_known_answer.py [--ntmu PROGRAM] [--curves N] [--seed S] [--venv DIR] [--json FILE]

Installs bjontegaard (Friedrich-Alexander-Universität Erlangen-Nürnberg, BSD-3-Clause; it interpolates with
SciPy) into a virtual environment in a temporary folder, or in DIR if given. Compares BD-rate and BD-PSNR by
PCHIP and by Akima on the example of its README and on N pairs of seeded random monotone curves of 3 to 12
points, matching or not in their number. Exits with 1 if any value differs by more than 1e-6.

Without --ntmu the program is built with `cargo build --no-default-features`.
"""

import argparse
import json
import os
import random
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
METHODS = ("pchip", "akima")
ALLOWED = 1e-6

# README of bjontegaard: kbit/s and dB of x265 with two presets.
README = (
    [(9487.76, 40.037), (4593.60, 38.615), (2486.44, 36.845), (1358.24, 34.851)],
    [(9787.80, 40.121), (4469.00, 38.651), (2451.52, 36.970), (1356.24, 34.987)],
)


def parse():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ntmu", type=Path, help="the program; built without it")
    parser.add_argument("--curves", type=int, default=200, help="random pairs")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--venv", type=Path, help="a virtual environment to keep")
    parser.add_argument("--json", type=Path, help="where to write the figures")
    return parser.parse_args()


def interpreter(folder):
    """A Python that has bjontegaard."""
    python = folder / "bin" / "python3"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    pip = [str(python), "-m", "pip", "install", "-q", "bjontegaard"]
    subprocess.run(pip, check=True, stdout=sys.stderr)
    return python


def program(arguments):
    if arguments.ntmu:
        return arguments.ntmu.resolve()
    build = ["cargo", "build", "-q", "--no-default-features", "--bin", "ntmu"]
    subprocess.run(build, cwd=ROOT, check=True)
    return TARGET / "debug" / "ntmu"


def random_curve(numbers, start):
    """Points of a rising curve; rates are multiplied, metrics added up."""
    rate, metric = start
    points = []
    for _ in range(numbers.randint(3, 12)):
        points.append((rate, metric))
        rate *= 1.0 + numbers.uniform(0.05, 2.0)
        metric += numbers.uniform(0.05, 3.0)
    numbers.shuffle(points)
    return points


def pairs(count, seed):
    yield README
    numbers = random.Random(seed)
    while count > 0:
        anchor = random_curve(numbers, (numbers.uniform(0.02, 0.3), numbers.uniform(24, 30)))
        test = random_curve(numbers, (numbers.uniform(0.02, 0.3), numbers.uniform(24, 30)))
        if overlap(anchor, test, 0) and overlap(anchor, test, 1):
            yield anchor, test
            count -= 1


def overlap(a, b, axis):
    low = max(min(p[axis] for p in a), min(p[axis] for p in b))
    high = min(max(p[axis] for p in a), max(p[axis] for p in b))
    # Shorter than that, the mean divides rounding errors by next to nothing.
    return high - low > 1e-3


def theirs(anchor, test, method):
    """Percent and dB by bjontegaard, which wants rates ascending."""
    import bjontegaard

    rate_a, psnr_a = zip(*sorted(anchor))
    rate_t, psnr_t = zip(*sorted(test))
    how = {"method": method, "require_matching_points": False, "min_overlap": 0}
    curves = (rate_a, psnr_a, rate_t, psnr_t)
    return float(bjontegaard.bd_rate(*curves, **how)), float(bjontegaard.bd_psnr(*curves, **how))


def ours(ntmu, anchor, test, method, folder):
    names = []
    for name, points in (("anchor", anchor), ("test", test)):
        path = Path(folder) / f"{name}.json"
        results = {"bpp": [p[0] for p in points], "psnr": [p[1] for p in points]}
        path.write_text(json.dumps({"name": name, "description": "", "results": results}))
        names.append(str(path))
    command = [str(ntmu), "curve", "bd", *names, "--method", method, "--json"]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    found = json.loads(printed)["tests"][0]
    return found["bd_rate"]["value"], found["bd_psnr"]["value"]


def compare(arguments):
    warnings.simplefilter("ignore")
    ntmu = program(arguments)
    worst = {method: [0.0, 0.0] for method in METHODS}
    readme = {}
    with tempfile.TemporaryDirectory() as folder:
        for index, (anchor, test) in enumerate(pairs(arguments.curves, arguments.seed)):
            for method in METHODS:
                known = theirs(anchor, test, method)
                found = ours(ntmu, anchor, test, method, folder)
                if index == 0:
                    readme[method] = {"theirs": known, "ours": found}
                for measure in range(2):
                    difference = abs(known[measure] - found[measure])
                    # A NaN is no agreement.
                    if not difference <= worst[method][measure]:
                        worst[method][measure] = difference
    import importlib.metadata as metadata

    figures = {
        "versions": {name: metadata.version(name) for name in ("bjontegaard", "scipy", "numpy")},
        "pairs": 1 + arguments.curves,
        "seed": arguments.seed,
        "readme": readme,
        "largest_difference": {m: {"bd_rate_percent": w[0], "bd_psnr_db": w[1]} for m, w in worst.items()},
        "allowed": ALLOWED,
    }
    print(json.dumps(figures, indent=2))
    if arguments.json:
        arguments.json.write_text(json.dumps(figures, indent=2) + "\n")
    return all(difference <= ALLOWED for pair in worst.values() for difference in pair)


def main():
    arguments = parse()
    if os.environ.get("NTMU_BD"):
        return 0 if compare(arguments) else 1
    with tempfile.TemporaryDirectory() as folder:
        python = interpreter(arguments.venv or Path(folder) / "environment")
        # The environment is gone behind this block, so the comparison runs inside it.
        environment = {**os.environ, "NTMU_BD": "1"}
        return subprocess.run([str(python), *sys.argv], env=environment).returncode


if __name__ == "__main__":
    sys.exit(main())
