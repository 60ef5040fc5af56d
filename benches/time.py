#!/usr/bin/env python3
"""How fast the unit is simulated: runs `cargo bench -p ntmu-model --bench time` and writes its figures.

    python3 benches/time.py [--json FILE] [--no-run]

One thread, preset `desktop`, a set of the shape of CNTC-16 at 1024² and the same set as plain maps. Cycles
are the simulated unit's; making the demands is part of the time. `fastest` is the fastest sample, `mean`
criterion's; `--no-run` takes the results that lie under the target folder.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", default=str(ROOT / "benches" / "results" / "time.json"))
    parser.add_argument("--no-run", action="store_true")
    arguments = parser.parse_args()
    load = os.getloadavg()
    if not arguments.no_run:
        subprocess.run(["cargo", "bench", "-q", "-p", "ntmu-model", "--bench", "time"], cwd=ROOT, check=True,
                       stdout=sys.stderr)
    folder = TARGET / "criterion" / "time"
    facts = json.loads((folder / "facts.json").read_text())
    seconds = {}
    for path in folder.glob("*/new/estimates.json"):
        about = json.loads((path.parent / "benchmark.json").read_text())
        sample = json.loads((path.parent / "sample.json").read_text())
        fastest = min(t / n for t, n in zip(sample["times"], sample["iters"]))
        mean = json.loads(path.read_text())["mean"]["point_estimate"]
        seconds[about["function_id"]] = {"fastest": fastest * 1e-9, "mean": mean * 1e-9}
    figures = []
    for run in facts["runs"]:
        took = seconds[run["name"]]
        rates = {f"{what}_per_second": run[what] / took["fastest"] for what in ("cycles", "pixels", "decodes")}
        figures.append({**run, "seconds": took, **rates})
        print(f"{run['name']:28}{rates['cycles_per_second'] / 1e6:9.1f} M cycles/s{rates['pixels_per_second'] / 1e6:9.3f} "
              f"M pixels/s{rates['decodes_per_second'] / 1e6:9.3f} M decodes/s{run['peak_bytes'] / 2**20:9.2f} MiB")
    cpu = next((line.split(":")[1].strip() for line in Path("/proc/cpuinfo").read_text().splitlines()
                if line.startswith("model name")), platform.processor())
    rustc = subprocess.run(["rustc", "--version"], capture_output=True, text=True).stdout.strip()
    conditions = {"cpu": cpu, "cpus": os.cpu_count(), "system": f"{platform.system()} {platform.machine()}", "rustc": rustc,
                  "threads": 1, "unit": facts["unit"], "screen": [512, 512], "load_average": load,
                  "load_average_after": os.getloadavg(), "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())}
    path = Path(arguments.json)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"conditions": conditions, "figures": figures}, indent=1) + "\n")
    print(f"written to {path}", file=sys.stderr)


if __name__ == "__main__":
    main()
