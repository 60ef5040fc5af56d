#!/usr/bin/env python3
"""What the project has for a GPU, in one go: the twin's tests, a training curve, the twin on a trained asset.

    python3 benches/gpu.py BINARY [--set DIR] [--backend vulkan] [--minutes 10] [--preset cntc-16] [--json FILE]

BINARY is a stripped release build with the features `gpu` and `train-vulkan` (or `train-wgpu` with
`--backend wgpu`); nothing else is needed beside Python and a driver, no toolchain and no checkout.
Without `--set` the built-in texture set is trained on.

1. `conform run --on gpu`: the built-in vectors on the twin, and the same on the model.
2. `encode --backend …`: the curve of the stages in reals, first the encoder's on crops. It is stopped
   after `--minutes`; how far it came is part of the result.
3. `study` of the asset, if training came to its end, else of the built-in one: every texel of every mip
   on the twin against the model, word for word.
"""

import argparse
import json
import os
import platform
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def run(command, **more):
    started = time.monotonic()
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, **more)
    took = time.monotonic() - started
    found = None
    try:
        found = json.loads(done.stdout)
    except ValueError:
        pass
    return {"command": " ".join(str(part) for part in command[1:]), "status": done.returncode,
            "seconds": round(took, 3), "result": found, "stderr": done.stderr[-2000:]}


PLAN = """name = "gpu"
[[stage]]
train = "encoder"
steps = {steps}
crop = {crop}
crops = 4
latents = "noise"
numbers = "real"
[[stage]]
train = "latents"
steps = {steps}
latents = "noise"
numbers = "real"
[[stage]]
train = "latents"
steps = 200
latents = "rounded"
numbers = "deployed"
"""


def train(arguments, folder):
    """The curve of a run of `encode`, from the log that it writes."""
    asset, config, plan, log = (folder / name for name in ("trained.ntx", "config.toml", "plan.toml", "train.jsonl"))
    # Crops, width and batch of the paper's last rows; steps that a GPU does not exhaust in minutes.
    config.write_text(f"encoder_width = {arguments.width}\nbatch = {arguments.batch}\ncheckpoint_every = 1000\n")
    plan.write_text(PLAN.format(steps=arguments.steps, crop=arguments.crop))
    source = [arguments.set] if arguments.set else ["--built-in"]
    command = [arguments.binary, "encode", *source, "-o", asset, "--preset", arguments.preset, "--config", config,
               "--plan", plan, "--backend", arguments.backend, "--log", log, "--json"]
    started = time.monotonic()
    process = subprocess.Popen([str(part) for part in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    signal.signal(signal.SIGALRM, lambda *_: process.send_signal(signal.SIGINT))
    signal.alarm(max(1, int(60 * arguments.minutes)))
    notes = []
    for line in process.stderr:
        notes.append(line.rstrip())
        print(line.rstrip(), file=sys.stderr)
    output = process.stdout.read()
    status = process.wait()
    signal.alarm(0)
    return {"command": " ".join(str(part) for part in command[1:]), "config": config.read_text(),
            "plan": plan.read_text(), "status": status, "seconds": round(time.monotonic() - started, 3),
            "curve": [json.loads(row) for row in log.read_text().splitlines()] if log.exists() else [], "notes": notes,
            "result": json.loads(output) if status == 0 and output else None}, asset


def rates(curve):
    """Steps a second of each stage between its first and its last line of the log."""
    out = {}
    for stage in {point["stage"] for point in curve}:
        points = [point for point in curve if point["stage"] == stage]
        took = points[-1]["seconds"] - points[0]["seconds"]
        if took > 0:
            out[stage] = (points[-1]["step"] - points[0]["step"]) / took
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("binary", type=Path)
    parser.add_argument("--set", type=Path, help="a texture set; the built-in one without it")
    parser.add_argument("--backend", default="vulkan")
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--preset", default="cntc-16")
    parser.add_argument("--width", type=int, default=192, help="channels of the encoder")
    parser.add_argument("--crop", type=int, default=512)
    parser.add_argument("--batch", type=int, default=12288)
    parser.add_argument("--steps", type=int, default=20000, help="steps of each stage in reals")
    parser.add_argument("--json", type=Path, default=Path("gpu.json"))
    arguments = parser.parse_args()
    arguments.binary = arguments.binary.resolve()
    load = os.getloadavg()
    with tempfile.TemporaryDirectory() as folder:
        vectors = {on: run([arguments.binary, "conform", "run", "--on", on, "--json"]) for on in ("gpu", "model")}
        training, asset = train(arguments, Path(folder))
        subject = [asset] if asset.exists() else []
        study = run([arguments.binary, "study", *subject, "--quick", "--json"], cwd=folder)
    twin = (study["result"] or {}).get("twin")
    cpu = next((line.split(":")[1].strip() for line in Path("/proc/cpuinfo").read_text().splitlines()
                if line.startswith("model name")), platform.processor())
    conditions = {"adapter": (twin or {}).get("adapter"), "cpu": cpu, "cpus": os.cpu_count(), "backend": arguments.backend,
                  "system": f"{platform.system()} {platform.release()} {platform.machine()}",
                  "version": subprocess.run([arguments.binary, "--version"], capture_output=True, text=True).stdout.strip(),
                  "set": str(arguments.set.name if arguments.set else "built-in"), "load_average": load,
                  "load_average_after": os.getloadavg(), "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())}
    holds = vectors["gpu"]["status"] == 0 and study["status"] == 0 and bool(training["curve"])
    arguments.json.write_text(json.dumps({"conditions": conditions, "holds": holds, "vectors": vectors, "twin": twin,
                                          "steps_per_second": rates(training["curve"]), "training": training}, indent=1) + "\n")
    print(f"adapter {conditions['adapter']}; twin {twin and twin.get('status')}; "
          f"steps a second {rates(training['curve'])}; written to {arguments.json}")
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
