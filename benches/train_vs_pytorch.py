#!/usr/bin/env python3
"""The trainer beside PyTorch: same network, same start, same batches, same schedule, same threads, one run.

    python3 benches/train_vs_pytorch.py [--set FOLDER] [--preset NAME] [--seconds S ...] [--venv DIR] [--json FILE]

Latents and synthesizer are trained directly, in reals, as the first stage of `ntmu encode` does. The
PyTorch program draws its start, its texels and its noise from the same counters as the trainer, so that
both walk the same path until rounding parts them: the mean loss of the first twenty steps has to agree,
or the script ends with 1. Then, for every time given with --seconds, each gets as many steps as it makes in
that time, with the whole fall of the learning rate over them, and the PSNR of all mips and channels is
taken with rounded latents, the real synthesizer and outputs rounded to 8 bits. Steps per second and that
PSNR are the result; the ratio is ours over PyTorch's. For this both start at random and take Adam; a third
run, of as many steps as the trainer makes in that time, starts and moves as the trainer does by default.

PyTorch runs eagerly in f32 with fused Adam. The environment goes to `versus/` under the target folder.

The set is a folder of images whose names say which map they hold (by default the built-in set at 1024
texels); 8-bit images only, because another program has to read them alike.
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from environment import ROOT, TARGET, conditions, enter, write

# Which files hold which map, in the order of channels that the trainer gives them.
MAPS = {
    "color": ("color", "diff", "albedo"),
    "normal": ("normal",),
    "roughness": ("rough",),
    "metalness": ("metal",),
    "height": ("height", "displacement"),
    "occlusion": ("occlusion", "_ao"),
    "opacity": ("opacity",),
}

GOLDEN = 0x9E3779B97F4A7C15
PURPOSES = ("synthesizer", "encoder", "latents", "batch", "noise", "crop", "calibration")
MASK = (1 << 64) - 1


def parse():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--set", help="folder of a texture set; the built-in one without it")
    parser.add_argument("--preset", default="cntc-16")
    parser.add_argument("--batch", type=int, default=16128, help="texels of a step, a multiple of 768")
    parser.add_argument("--seconds", type=float, nargs="+", default=[60.0], help="times for the comparison at equal time")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--binary", help="an ntmu with the trainer; built without it")
    parser.add_argument("--venv", default=str(TARGET / "versus" / "environment"))
    parser.add_argument("--json", default=str(ROOT / "benches" / "results" / "train_vs_pytorch.json"))
    return parser.parse_args()


def mix(x):
    """The finaliser of SplitMix64 on Python integers."""
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & MASK
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & MASK
    return x ^ (x >> 31)


class Stream:
    """The trainer's numbers: a function of (seed, purpose, step, index)."""

    def __init__(self, seed, purpose, step):
        of_purpose = mix((seed + GOLDEN * (PURPOSES.index(purpose) + 1)) & MASK)
        self.key = mix(of_purpose ^ mix((step + GOLDEN) & MASK))

    def bits(self, index):
        import numpy as np

        x = np.uint64(self.key) + np.uint64(GOLDEN) * index.astype(np.uint64)
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return x ^ (x >> np.uint64(31))

    def unit(self, index):
        import numpy as np

        return (self.bits(index) >> np.uint64(11)).astype(np.float64) * 2.0**-53

    def signed(self, index):
        import numpy as np

        return (2 * self.unit(index) - 1).astype(np.float32)

    def below(self, index, bound):
        import numpy as np

        return ((self.bits(index) >> np.uint64(32)) * bound.astype(np.uint64)) >> np.uint64(32)

    def noise(self, grid, count):
        """Uniform noise of ±½ for every latent of a grid: a 32-bit hash of its index."""
        import numpy as np

        key = np.uint32(((self.key >> 32) + grid) & 0xFFFFFFFF)
        x = (np.arange(count, dtype=np.uint32) * np.uint32(0x9E3779B9)) ^ key
        x = (x ^ (x >> np.uint32(16))) * np.uint32(0x21F0AAAD)
        x = (x ^ (x >> np.uint32(15))) * np.uint32(0xD35A2D97)
        x ^= x >> np.uint32(15)
        return ((x >> np.uint32(8)).astype(np.int32) - (1 << 23)).astype(np.float32) * np.float32(2.0**-24)


def read_set(folder, maps):
    """Mips of [row, column, channel], 0..=1, with the channels of these maps."""
    import numpy as np
    from PIL import Image

    files = sorted(p for p in Path(folder).iterdir() if p.suffix.lower() in (".png", ".jpg", ".jpeg", ".tga"))
    planes = []
    for name in maps:
        found = [p for p in files if any(part in p.stem.lower() for part in MAPS.get(name, ()))]
        if len(found) != 1:
            sys.exit(f"{folder}: found {len(found)} files for map {name!r}; allowed: one whose name has one of {MAPS.get(name)}")
        image = np.asarray(Image.open(found[0]))
        if image.dtype != np.uint8:
            sys.exit(f"{found[0]}: found {image.dtype}; allowed: 8 bits")
        image = image.reshape(*image.shape[:2], -1).astype(np.float32) / np.float32(255)
        grey = image.shape[2] == 3 and (image == image[..., :1]).all()
        planes.append(image[..., :1] if grey else image)
    mips = [np.concatenate(planes, axis=2)]
    size = max(mips[0].shape[:2])
    for _ in range(max(int(math.log2(size)) - 2, 0)):
        fine = mips[-1]
        h, w = max(fine.shape[0] // 2, 1), max(fine.shape[1] // 2, 1)
        fine = fine[: 2 * h, : 2 * w]
        mips.append(((fine[0::2, 0::2] + fine[0::2, 1::2]) + (fine[1::2, 0::2] + fine[1::2, 1::2])) * np.float32(0.25))
    return mips


class Setting:
    """What both train: the trainer's configuration, the set, and the tables that give a texel its inputs."""

    def __init__(self, config, mips, seed, batch):
        import numpy as np
        import torch

        self.config, self.seed, self.batch = config, seed, batch
        for field, wanted in [("activation", {"leaky": {"shift": 3}}), ("wave", "triangle"), ("snap", "stride"),
                              ("address", "wrap"), ("sampling", ["corners", "interpolated"])]:
            if config[field] != wanted:
                sys.exit(f"{field}: found {config[field]}; allowed: {wanted}")
        self.sizes = [(m.shape[1], m.shape[0]) for m in mips]
        self.channels = mips[0].shape[2]
        self.mips = mips
        starts = np.cumsum([0] + [w * h for w, h in self.sizes])
        self.texel_start = torch.from_numpy(starts[:-1].astype(np.int64))
        self.texels = torch.from_numpy(np.concatenate([m.reshape(-1, self.channels) for m in mips]))
        self.grids = [(g["channels"], g["bits"], g["scale_log2"]) for g in config["grids"]]
        self.cells = [[-(-n // (1 << scale)) for n in self.sizes[0]] for _, _, scale in self.grids]
        self.axis = [[self.axis_tables(grid, axis) for axis in range(2)] for grid in range(2)]
        self.waves = [self.wave_table(axis) for axis in range(2)]
        self.axis_start = [torch.tensor(np.cumsum([0] + [s[axis] for s in self.sizes])[:-1]) for axis in range(2)]
        last = len(mips) - 1
        half = (1 << config["input_bits"] - 1) - 1
        levels = [(2 * half * m + last) // (2 * last) if last else 0 for m in range(last + 1)]
        self.levels = torch.tensor(levels, dtype=torch.float32) / (half + 1)

    def axis_tables(self, grid, axis):
        """First and second cell and the weight of the second, for every texel of every mip."""
        import numpy as np
        import torch

        scale, cells = self.grids[grid][2], self.cells[grid][axis]
        first, second, phase = [], [], []
        for mip, size in enumerate(self.sizes):
            texel = np.arange(size[axis], dtype=np.int64)
            log2 = scale + 1
            stride = max(mip - scale, 0)
            place = ((2 * texel + 1) << mip) - (1 << log2 - 1)
            corner = ((place >> log2) >> stride) << stride
            first.append(corner % cells)
            second.append((corner + (1 << stride)) % cells)
            phase.append(((place - (corner << log2)) << 4) >> (log2 + stride))
        as_tensor = lambda parts: torch.from_numpy(np.concatenate(parts))
        return as_tensor(first), as_tensor(second), as_tensor(phase).float() / 16

    def wave_table(self, axis):
        """The waves of every texel of every mip along an axis, octave by octave, two phases each."""
        import numpy as np
        import torch

        parts = []
        one = 1 << self.config["input_bits"] - 1
        for mip, size in enumerate(self.sizes):
            texel = np.arange(size[axis], dtype=np.int64)
            rows = []
            for octave in range(self.config["octaves"]):
                for quarter in (0, 4):
                    turns = ((((2 * texel + 1) << mip) << octave) + quarter) & 15
                    wave = (np.abs(2 * turns - 16) - 8) / 8
                    rows.append(np.minimum(wave * one, one - 1) / one)
            parts.append(np.stack(rows, axis=1))
        return torch.from_numpy(np.concatenate(parts).astype(np.float32))

    def draw(self, step_key):
        """x, y and mip of the texels of a step."""
        import numpy as np
        import torch

        stream = Stream(self.seed, "batch", step_key)
        at = 4 * np.arange(self.batch, dtype=np.uint64)
        choice, u = stream.unit(at), stream.unit(at + np.uint64(1))
        uniform, count = self.config["uniform_mips"], len(self.sizes)
        area = np.minimum(-np.log(1 - u) / np.log(4.0), count - 1).astype(np.int64)
        even = np.minimum((choice / uniform * count).astype(np.int64), count - 1) if uniform else area
        mip = np.where(choice < uniform, even, area)
        sizes = np.array(self.sizes)
        x = stream.below(at + np.uint64(2), sizes[mip, 0])
        y = stream.below(at + np.uint64(3), sizes[mip, 1])
        return tuple(torch.from_numpy(v.astype(np.int64)) for v in (x, y, mip))


def padded(n):
    return -(-n // 32) * 32


class Pytorch:
    """The same training in PyTorch."""

    def __init__(self, setting):
        import numpy as np
        import torch

        self.setting = setting
        config, seed = setting.config, setting.seed
        inputs = 4 * setting.grids[0][0] + setting.grids[1][0] + 4 * config["octaves"] + 1
        widths = [inputs, *config["hidden"], *[config["hidden"][-1]] * (2 * config["residual_blocks"]), setting.channels]
        stream, at, self.weights, self.biases = Stream(seed, "synthesizer", 0), 0, [], []
        plain = len(config["hidden"])
        self.plain = plain
        for index, (rows, columns) in enumerate(zip(widths[:-1], widths[1:])):
            is_block_end = plain <= index < len(widths) - 2 and (index - plain) % 2 == 1
            gain = (2.0 if index == 0 else 1.0) * (0.1 if is_block_end else 1.0)
            bound = np.float32(gain) * np.sqrt(np.float32(6.0) / np.float32(rows))
            place = at + np.arange(rows)[:, None] * padded(columns) + np.arange(columns)[None, :]
            self.weights.append(torch.from_numpy(bound * stream.signed(place)))
            self.biases.append(torch.zeros(columns))
            at += padded(rows) * padded(columns) + padded(columns)
        coarsest = setting.mips[-1].reshape(-1, setting.channels)
        self.biases[-1] += torch.from_numpy(coarsest.mean(axis=0))
        self.constant = [c for c in range(setting.channels) if all((m[..., c] == setting.mips[0][0, 0, c]).all() for m in setting.mips)]
        for channel in self.constant:
            self.weights[-1][:, channel] = 0
            self.biases[-1][channel] = float(setting.mips[0][0, 0, channel])
        stream, first, self.latents = Stream(seed, "latents", 0), 0, []
        for (channels, bits, _), cells in zip(setting.grids, setting.cells):
            count = cells[0] * cells[1] * channels
            low, high = -(1 << bits - 1) + 1, 1 << bits - 1
            values = np.float32(0.25 * (high - low)) * stream.signed(first + np.arange(count))
            self.latents.append(torch.from_numpy(np.clip(values, low, high).reshape(-1, channels)))
            first += count
        for tensor in [*self.weights, *self.biases, *self.latents]:
            tensor.requires_grad_(True)
        network = {"params": self.weights + self.biases}
        latents = [{"params": [g]} for g in self.latents]
        self.adam = torch.optim.Adam([network, *latents], lr=1.0, betas=(0.9, 0.99), eps=1e-15, fused=True)

    def inputs(self, seen, x, y, mip):
        import torch

        s = self.setting
        at = [s.axis_start[0][mip] + x, s.axis_start[1][mip] + y]
        rows = []
        for grid, (channels, bits, _) in enumerate(s.grids):
            (x0, x1, fx), (y0, y1, fy) = ([t[at[axis]] for t in s.axis[grid][axis]] for axis in range(2))
            width = s.cells[grid][0]
            corners = torch.stack([y0 * width + x0, y0 * width + x1, y1 * width + x0, y1 * width + x1], dim=1)
            found = seen[grid].index_select(0, corners.reshape(-1)).view(len(x), 4, channels) / (1 << bits)
            if grid == 0:
                rows.append(found.view(len(x), -1))
            else:
                weights = torch.stack([(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy], dim=1)
                rows.append((found * weights.unsqueeze(2)).sum(dim=1))
        octaves = s.config["octaves"]
        of_axes = [s.waves[axis][at[axis]].view(-1, octaves, 2) for axis in range(2)]
        rows.append(torch.cat(of_axes, dim=2).view(len(x), -1))
        rows.append(s.levels[mip].unsqueeze(1))
        return torch.cat(rows, dim=1)

    def network(self, v):
        import torch
        from torch.nn.functional import leaky_relu

        layers = list(zip(self.weights, self.biases))
        for w, b in layers[: self.plain]:
            v = leaky_relu(torch.addmm(b, v, w), 0.125)
        for (w0, b0), (w1, b1) in zip(layers[self.plain : -1 : 2], layers[self.plain + 1 : -1 : 2]):
            v = v + torch.addmm(b1, leaky_relu(torch.addmm(b0, v, w0), 0.125), w1)
        return torch.addmm(layers[-1][1], v, layers[-1][0])

    def step(self, step, steps):
        import torch

        s, key = self.setting, step_key(step)
        noise = Stream(s.seed, "noise", key)
        seen = [g + torch.from_numpy(noise.noise(i, g.numel())).view_as(g) for i, g in enumerate(self.latents)]
        x, y, mip = s.draw(key)
        raw = self.network(self.inputs(seen, x, y, mip))
        target = s.texels[s.texel_start[mip] + y * torch.tensor([w for w, _ in s.sizes])[mip] + x]
        # Compared as the unit would emit it; the gradient passes the limits unchanged.
        limited = raw + (raw.clamp(0, 1) - raw).detach()
        loss = ((limited - target) ** 2).mean()
        self.adam.zero_grad(set_to_none=True)
        loss.backward()
        for channel in self.constant:
            self.weights[-1].grad[:, channel] = 0
            self.biases[-1].grad[channel] = 0
        factor = rate_factor(step, steps)
        groups = self.adam.param_groups
        groups[0]["lr"] = factor * RATES["synthesizer"]
        for group, (_, bits, _) in zip(groups[1:], s.grids):
            group["lr"] = factor * RATES["latents"] * (1 << bits)
        self.adam.step()
        with torch.no_grad():
            for latents, (_, bits, _) in zip(self.latents, s.grids):
                latents.clamp_(-(1 << bits - 1) + 1, 1 << bits - 1)
        return loss

    def psnr(self):
        """Of all mips and channels, with rounded latents, as stored in 8 bits."""
        import torch

        s, total = self.setting, 0.0
        with torch.no_grad():
            seen = [torch.floor(g + 0.5).clamp(-(1 << b - 1) + 1, 1 << b - 1) for g, (_, b, _) in zip(self.latents, s.grids)]
            for mip, ((width, height), start) in enumerate(zip(s.sizes, s.texel_start.tolist())):
                rows = max(1, 32768 // width)
                for top in range(0, height, rows):
                    at = torch.arange(top * width, min(top + rows, height) * width)
                    found = self.network(self.inputs(seen, at % width, at // width, torch.full_like(at, mip)))
                    found = torch.round(found.clamp(0, 1) * 255) / 255
                    total += float(((found - s.texels[start + at]).double() ** 2).sum())
        return -10 * math.log10(total / s.texels.numel())


def step_key(step):
    """The trainer's number of a step of its first stage."""
    return step


def rate_factor(step, steps):
    warm = max(min(100.0, 0.1 * steps), 1.0)
    rise = min((step + 1) / warm, 1.0)
    fall = 0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * min(step / max(steps, 1), 1.0)))
    return rise * fall


# Steps whose losses have to agree, and how well: f32 sums in another order, a few hundred terms long, part
# by about 1e-5; a difference of kind (a texel, a weight, a rate) parts them by far more.
COMPARED, AGREEMENT = 20, 1e-3

# Learning rates of the stage.
RATES = {"latents": 0.01, "synthesizer": 0.005}
SMOOTHING = 0.02


def binary(arguments):
    if arguments.binary:
        return arguments.binary
    subprocess.run(["cargo", "build", "--release", "-q", "--features", "train"], cwd=ROOT, check=True)
    return str(TARGET / "release" / "ntmu")


# What the PyTorch program does.
ALIKE = f'''optimiser = "adam"
rates = {{ latents = {RATES["latents"]}, synthesizer = {RATES["synthesizer"]} }}
'''


def encode(program, folder, arguments, steps, source, alike=True):
    """Trains `steps` steps in reals, as the PyTorch program does or as by default; the result and the log."""
    plan, config = folder / "plan.toml", folder / "config.toml"
    first = "random" if alike else "components"
    plan.write_text(
        f'name = "reals"\nfirst_latents = "{first}"\n[[stage]]\ntrain = "latents"\nsteps = {steps}\nbatch = {arguments.batch}\n'
        f'warm_up = 100\nlatents = "noise"\nnumbers = "real"\n{ALIKE if alike else ""}'
    )
    config.write_text(f"checkpoint_every = {1 << 40}\n")
    log, out = folder / "train.jsonl", folder / "out.ntx"
    log.unlink(missing_ok=True)
    command = [program, "encode", str(source), "-o", str(out), "--preset", arguments.preset, "--plan", str(plan),
               "--config", str(config), "--seed", str(arguments.seed), "--log", str(log), "--json"]
    environment = {**os.environ, "RAYON_NUM_THREADS": str(arguments.threads)}
    result = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    return json.loads(result.stdout), [json.loads(line) for line in log.read_text().splitlines()]


def main():
    arguments = parse()
    enter(arguments.venv, ["numpy", "pillow"], True)
    import numpy
    import torch

    torch.set_num_threads(arguments.threads)
    before = conditions([numpy, torch])
    program = binary(arguments)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        source = Path(arguments.set) if arguments.set else folder / "set"
        if not arguments.set:
            subprocess.run([program, "generate", "-o", str(source), "--size", "1024"], check=True, stdout=subprocess.DEVNULL)
        measured, log = encode(program, folder, arguments, 10 * COMPARED, source)
        config = measured["training"]["config"]
        maps = [m["map"] for m in measured["quality"]["maps"]]
        setting = Setting(config, read_set(source, maps), arguments.seed, arguments.batch)

        theirs, smooth = Pytorch(setting), None
        for step in range(COMPARED):
            loss = theirs.step(step, 10 * COMPARED).item()
            smooth = loss if smooth is None else smooth + SMOOTHING * (loss - smooth)
        ours = next(line["loss"] for line in log if line["step"] == COMPARED)
        apart = abs(ours / smooth - 1)
        print(f"loss after {COMPARED} steps: {ours:.6e} and in PyTorch {smooth:.6e}, {apart:.1e} apart", file=sys.stderr)
        if apart > AGREEMENT:
            sys.exit(1)

        start, warm = time.perf_counter(), 40
        for step in range(COMPARED, COMPARED + warm):
            theirs.step(step, 10 * COMPARED)
        speeds = {"torch": warm / (time.perf_counter() - start)}
        stage = measured["training"]["stages"][0]
        speeds["ntmu"] = 10 * COMPARED / stage["seconds"]

        def ours_in(steps, alike):
            result, _ = encode(program, folder, arguments, steps, source, alike)
            training = result["training"]
            return {"steps": steps, "seconds": training["stages"][0]["seconds"], "psnr": training["psnr_float"]}

        figures = []
        for seconds in arguments.seconds:
            steps = max(int(seconds * speeds["torch"]), 1)
            theirs = Pytorch(setting)
            start = time.perf_counter()
            for step in range(steps):
                theirs.step(step, steps)
            took = time.perf_counter() - start
            speeds["torch"] = steps / took
            torch_figure = {"steps": steps, "seconds": took, "psnr": theirs.psnr()}
            # As long as the other took, at the speed of the run before.
            steps = max(int(took * speeds["ntmu"]), 1)
            our_figure = ours_in(steps, True)
            speeds["ntmu"] = steps / our_figure["seconds"]
            default_figure = ours_in(steps, False)
            figures.append({"seconds": seconds, "ntmu": our_figure, "torch": torch_figure, "ntmu_by_default": default_figure,
                            "steps_ratio": speeds["ntmu"] / speeds["torch"], "psnr_ahead": our_figure["psnr"] - torch_figure["psnr"]})
            print(f"{seconds:6.0f} s  ntmu {our_figure['steps']} steps, {our_figure['psnr']:.2f} dB   "
                  f"torch {torch_figure['steps']} steps, {torch_figure['psnr']:.2f} dB   "
                  f"steps {figures[-1]['steps_ratio']:.2f} times, {figures[-1]['psnr_ahead']:+.2f} dB; "
                  f"by default {default_figure['psnr']:.2f} dB in {default_figure['seconds']:.0f} s")
    write(arguments.json, {"conditions": {**before, "load_average_after": os.getloadavg()}, "set": Path(arguments.set).name if arguments.set else "built-in, 1024",
                           "preset": arguments.preset, "batch": arguments.batch, "threads": arguments.threads,
                           "agreement": apart, "figures": figures})


if __name__ == "__main__":
    main()
