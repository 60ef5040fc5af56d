"""A virtual environment of its own for a benchmark, and what is said of the machine that ran it."""

import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))

TORCH_INDEX = "https://download.pytorch.org/whl/cpu"
INSIDE = "NTMU_BENCH_ENVIRONMENT"


def enter(venv, packages, with_torch):
    """Runs the calling script again inside the virtual environment `venv`, which is made first if need be."""
    if os.environ.get(INSIDE) == str(venv):
        return
    python = Path(venv) / "bin" / "python3"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(venv)], check=True)
    listed = subprocess.run([python, "-m", "pip", "list", "--format=json"], check=True, capture_output=True)
    installed = {package["name"].lower() for package in json.loads(listed.stdout)}
    missing = [name for name in packages if name.lower() not in installed]
    if missing:
        print("installing", *missing, "into", venv, file=sys.stderr)
        subprocess.run([python, "-m", "pip", "install", "-q", *missing], check=True)
    if with_torch and "torch" not in installed:
        print("installing torch into", venv, file=sys.stderr)
        pip = [python, "-m", "pip", "install", "-q", "torch"]
        cpu_only = subprocess.run([*pip, "--index-url", TORCH_INDEX], capture_output=True)
        if cpu_only.returncode != 0 and subprocess.run(pip).returncode != 0:
            print("torch: no wheel could be installed", file=sys.stderr)
    os.environ[INSIDE] = str(venv)
    os.execv(python, [str(python), *sys.argv])


def conditions(modules):
    """Processor, system, versions of these imported modules, load and time."""
    cpuinfo = Path("/proc/cpuinfo")
    keys = ("model name", "cpu family", "model\t")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    facts = [line.split(":")[1].strip() for line in lines if line.startswith(keys)]
    cpu = " ".join(dict.fromkeys(facts)) or platform.processor()
    rustc = subprocess.run(["rustc", "--version"], capture_output=True, text=True)
    versions = {module.__name__: module.__version__ for module in modules}
    versions |= {"python": platform.python_version(), "rustc": rustc.stdout.strip()}
    return {
        "cpu": cpu,
        "cpus": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "versions": versions,
        "load_average": os.getloadavg(),
        "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
    }


def write(path, results):
    """Writes a result beside its place and renames it."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_suffix(".part")
    beside.write_text(json.dumps(results, indent=1) + "\n")
    beside.replace(path)
    print(f"written to {path}", file=sys.stderr)
