#!/usr/bin/env python3
"""The engine beside ONNX Runtime and PyTorch: same networks, same texels, same threads, one run.

    python3 benches/versus.py [--seconds S] [--no-torch] [--venv DIR] [--json FILE]

Runs `cargo bench -p ntmu-model`, whose criterion results it reads, and measures the others before and
behind it on the batches that the benchmark exports. ONNX Runtime computes the int8 networks in every
int8 form that it has, and the fp16 networks in f32 and in fp16; PyTorch computes both kinds in f32, fp16
and bf16, and the int8 networks with its quantised operators. The fastest of each counts. ONNX Runtime's
QLinearMatMul has no bias, so it computes another network; its ratio stands in a line of its own.

Two ratios are printed against each contestant. `row-major` is like for like: inputs and codes lie texel
after texel, as the others take and give them. `blocked` is the engine on its own order of inputs and
codes, as the decoder uses it, against the others' only order.

The figure of a contestant, the engine included, is its fastest repetition, because other work on the
machine can only slow one down; criterion's mean is in the JSON beside it. Both int8 engines round to
nearest, ONNX Runtime in f32 with ties to even, the engine exactly with ties up; the share of codes that
differ and the largest difference are printed. A difference of 1 in one layer may grow in those behind.

The environment goes to `versus/` under the target folder: numpy, onnx, onnxruntime and, unless
--no-torch, the CPU build of torch.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

from environment import ROOT, TARGET, conditions, enter, write


def parse():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=0.25, help="time for every figure of a contestant, twice")
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2], choices=[1, 2])
    parser.add_argument("--no-torch", action="store_true", help="leave PyTorch out")
    parser.add_argument("--venv", default=str(TARGET / "versus" / "environment"))
    parser.add_argument("--json", default=str(ROOT / "benches" / "results" / "versus.json"))
    return parser.parse_args()


def cargo_bench(environment=None, *words):
    command = ["cargo", "bench", "-q", "-p", "ntmu-model", "--bench", "engine", "--", *words]
    environment = {**os.environ, **(environment or {})}
    subprocess.run(command, cwd=ROOT, env=environment, check=True, stdout=sys.stderr)


def criterion():
    """Seconds of every criterion benchmark: {(group, name, parameter): {"mean", "fastest"}}."""
    figures = {}
    for path in (TARGET / "criterion").glob("**/new/estimates.json"):
        about = json.loads((path.parent / "benchmark.json").read_text())
        sample = json.loads((path.parent / "sample.json").read_text())
        each = [t / n for t, n in zip(sample["times"], sample["iters"])]
        mean = json.loads(path.read_text())["mean"]["point_estimate"]
        key = (about["group_id"], about["function_id"], about["value_str"])
        elements = (about["throughput"] or {}).get("Elements")
        figures[key] = {"mean": mean * 1e-9, "fastest": min(each) * 1e-9, "elements": elements}
    return figures


class Network:
    """One exported network with its batch, as NumPy arrays."""

    def __init__(self, folder, name):
        import numpy as np

        data = json.loads((folder / f"{name}.json").read_text())
        self.name = name
        self.batch = data["batch"]
        self.layers = data["layers"]
        self.half = data["half"]
        self.macs = data["macs"]
        for layer in self.layers:
            shape = (layer["outputs"], layer["inputs"])
            if self.half:
                layer["weights"] = np.array(layer["weights"], np.float32).reshape(shape)
                layer["bias"] = np.array(layer["bias"], np.float32)
                continue
            layer["weights"] = np.array(layer["weights"], np.int8).reshape(shape)
            layer["bias"] = np.array(layer["bias"], np.int32)
            layer["scales"] = np.array(layer["scales"], np.float64)
        inputs = self.layers[0]["inputs"]
        self.inputs = np.fromfile(folder / f"{name}.inputs", np.int8).reshape(self.batch, inputs)
        self.codes = np.fromfile(folder / f"{name}.codes", np.uint8).reshape(self.batch, -1)
        self.reals = self.inputs.astype(np.float32) / 128


def onnx_model(network, form):
    """A network as an ONNX graph of uint8 activations and int8 weights, one scale for each row.

    The engine's integers are expressed as real scales: activation scale 1, so a weight's scale is its
    row's multiplier. The stored zero point of an activation is the engine's plus 128, and the bias is
    what it is before the zero point of the input is folded into it.
    """
    import numpy as np
    from onnx import TensorProto, helper, numpy_helper

    nodes, constants, outputs = [], [], []

    def constant(name, array):
        constants.append(numpy_helper.from_array(array, name))
        return name

    constant("one", np.float32(1))
    zero_in = 128
    x = "x"
    for index, layer in enumerate(network.layers):
        is_last = index + 1 == len(network.layers)
        zero_out = 0 if is_last else layer["zero_point"] + 128
        weights = np.ascontiguousarray(layer["weights"].T)
        scales = layer["scales"].astype(np.float32)
        # bias = folded bias + (zero point of the input as a signed value) * sum of weights
        signed = zero_in - 128
        bias = (layer["bias"] + signed * layer["weights"].astype(np.int32).sum(axis=1)).astype(np.int32)
        w = constant(f"w{index}", weights)
        s = constant(f"s{index}", scales)
        zw = constant(f"zw{index}", np.zeros(len(scales), np.int8))
        zi = constant(f"zi{index}", np.uint8(zero_in))
        zo = constant(f"zo{index}", np.uint8(zero_out))
        y = f"a{index}" if not is_last else "y"
        if form == "QGemm":
            # A zero point of 0 makes the saturation of the result the ReLU.
            b = constant(f"b{index}", bias)
            nodes.append(helper.make_node("QGemm", [x, "one", zi, w, s, zw, b, "one", zo], [y],
                                          domain="com.microsoft", alpha=1.0, transA=0, transB=0))
        elif form == "QDQ":
            b = constant(f"b{index}", bias)
            nodes += [
                helper.make_node("DequantizeLinear", [x, "one", zi], [f"xf{index}"]),
                helper.make_node("DequantizeLinear", [w, s, zw], [f"wf{index}"], axis=1),
                helper.make_node("DequantizeLinear", [b, s], [f"bf{index}"], axis=0),
                helper.make_node("Gemm", [f"xf{index}", f"wf{index}", f"bf{index}"], [f"g{index}"]),
            ]
            top = f"g{index}"
            if not is_last:
                nodes.append(helper.make_node("Relu", [top], [f"r{index}"]))
                top = f"r{index}"
            nodes.append(helper.make_node("QuantizeLinear", [top, "one", zo], [y]))
        elif form == "MatMulInteger":
            b = constant(f"b{index}", (bias * layer["scales"]).astype(np.float32))
            nodes += [
                helper.make_node("MatMulInteger", [x, w, zi], [f"m{index}"]),
                helper.make_node("Cast", [f"m{index}"], [f"c{index}"], to=TensorProto.FLOAT),
                helper.make_node("Mul", [f"c{index}", s], [f"p{index}"]),
                helper.make_node("Add", [f"p{index}", b], [f"q{index}"]),
                helper.make_node("QuantizeLinear", [f"q{index}", "one", zo], [y]),
            ]
        elif form == "QLinearMatMul":
            # This operator has no bias, so the network is another one; only its speed is compared.
            nodes.append(helper.make_node("QLinearMatMul", [x, "one", zi, w, s, zw, "one", zo], [y]))
        else:
            raise ValueError(form)
        if layer["skip"] is not None:
            source = outputs[index - layer["skip"]["span"]]
            k = constant(f"k{index}", np.float32(layer["skip"]["scale"]))
            nodes.append(helper.make_node("QLinearAdd", [y, "one", zo, source, k, zo, "one", zo],
                                          [f"t{index}"], domain="com.microsoft"))
            y = f"t{index}"
        outputs.append(y)
        x = y
        zero_in = zero_out
    graph = helper.make_graph(
        nodes, network.name,
        [helper.make_tensor_value_info("x", TensorProto.UINT8, [network.batch, network.layers[0]["inputs"]])],
        [helper.make_tensor_value_info("y", TensorProto.UINT8, [network.batch, network.layers[-1]["outputs"]])],
        constants)
    opsets = [helper.make_opsetid("", 17), helper.make_opsetid("com.microsoft", 1)]
    return helper.make_model(graph, opset_imports=opsets, ir_version=9).SerializeToString()


NO_BIAS = "onnxruntime QLinearMatMul"
FORMS = ["QGemm", "QDQ", "MatMulInteger", "QLinearMatMul"]


def onnx_float_model(network, is_half):
    """An fp16 network as an ONNX graph of Gemm and Relu."""
    import numpy as np
    from onnx import TensorProto, helper, numpy_helper

    kind, element = (np.float16, TensorProto.FLOAT16) if is_half else (np.float32, TensorProto.FLOAT)
    nodes, constants, x = [], [], "x"
    for index, layer in enumerate(network.layers):
        is_last = index + 1 == len(network.layers)
        constants.append(numpy_helper.from_array(np.ascontiguousarray(layer["weights"].T.astype(kind)), f"w{index}"))
        constants.append(numpy_helper.from_array(layer["bias"].astype(kind), f"b{index}"))
        y = "y" if is_last else f"g{index}"
        nodes.append(helper.make_node("Gemm", [x, f"w{index}", f"b{index}"], [y]))
        if not is_last:
            nodes.append(helper.make_node("Relu", [y], [f"r{index}"]))
            y = f"r{index}"
        x = y
    shapes = [[network.batch, network.layers[0]["inputs"]], [network.batch, network.layers[-1]["outputs"]]]
    graph = helper.make_graph(nodes, network.name, [helper.make_tensor_value_info("x", element, shapes[0])],
                              [helper.make_tensor_value_info("y", element, shapes[1])], constants)
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9).SerializeToString()


def onnx_session(model, threads):
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(model, options, ["CPUExecutionProvider"])


def onnx_contestants(network, threads):
    import numpy as np

    if network.half:
        for form, is_half in [("f32", False), ("fp16", True)]:
            session = onnx_session(onnx_float_model(network, is_half), threads)
            x = network.reals.astype(np.float16 if is_half else np.float32)
            codes = np.clip(np.rint(session.run(None, {"x": x})[0].astype(np.float64) * 255), 0, 255)
            yield f"onnxruntime {form}", apart(codes, network), (lambda s=session, x=x: s.run(None, {"x": x}))
        return
    x = (network.inputs.astype(np.int16) + 128).astype(np.uint8)
    for form in FORMS:
        session = onnx_session(onnx_model(network, form), threads)
        codes = session.run(None, {"x": x})[0]
        agreement = None if form == "QLinearMatMul" else apart(codes, network)
        yield f"onnxruntime {form}", agreement, (lambda session=session: session.run(None, {"x": x}))


def apart(codes, network):
    """How far codes are from the engine's."""
    import numpy as np

    distance = np.abs(codes.astype(np.int16) - network.codes.astype(np.int16))
    return {"differ": float((distance > 0).mean()), "largest": int(distance.max())}


def torch_contestants(network, threads):
    import numpy as np
    import torch

    torch.set_num_threads(threads)

    def blocks(x, linear, add):
        values = []
        for index, layer in enumerate(network.layers):
            x = linear(index, x)
            if layer["skip"] is not None:
                x = add(x, values[index - layer["skip"]["span"]])
            values.append(x)
        return x

    for name, dtype in [("f32", torch.float32), ("bf16", torch.bfloat16), ("fp16", torch.float16)]:
        unit = 1 if network.half else 1024
        weights = [torch.tensor(layer["weights"].astype(np.float32) / unit).to(dtype) for layer in network.layers]
        bias = [torch.zeros(layer["outputs"], dtype=dtype) for layer in network.layers]
        x = torch.tensor(network.reals).to(dtype)
        last = len(weights) - 1

        def linear(index, x, weights=weights, bias=bias):
            y = torch.nn.functional.linear(x, weights[index], bias[index])
            return y if index == last else torch.relu_(y)

        def run(x=x, linear=linear):
            with torch.inference_mode():
                blocks(x, linear, torch.add)

        yield f"torch {name}", None, run

    if network.half:
        return
    for engine in [e for e in ("x86", "fbgemm", "onednn") if e in torch.backends.quantized.supported_engines]:
        torch.backends.quantized.engine = engine
        ops = torch.ops.quantized
        packed = []
        for layer in network.layers:
            weights = torch.tensor(layer["weights"].astype(np.float32) * layer["scales"][:, None].astype(np.float32))
            scales = torch.tensor(layer["scales"])
            zeros = torch.zeros(len(scales), dtype=torch.long)
            weights = torch.quantize_per_channel(weights, scales, zeros, 0, torch.qint8)
            bias = torch.tensor((layer["bias"] * layer["scales"]).astype(np.float32))
            packed.append(ops.linear_prepack(weights, bias))
        x = torch.quantize_per_tensor(torch.tensor(network.inputs.astype(np.float32)), 1.0, 128, torch.quint8)
        last = len(packed) - 1

        def linear(index, x, packed=packed):
            op = ops.linear if index == last else ops.linear_relu
            return op(x, packed[index], 1.0, 0)

        def add(a, b):
            return ops.add(a, b, 1.0, 0)

        def run(x=x, linear=linear, add=add, engine=engine):
            torch.backends.quantized.engine = engine
            with torch.inference_mode():
                blocks(x, linear, add)

        yield f"torch int8 {engine}", None, run


# A contestant that takes longer for one batch is no contestant.
SLOWEST = 0.75


def contestants(networks, threads, with_torch):
    """Everything that computes the networks, with an agreement where the codes are the same ones."""
    for network in networks:
        sources = [onnx_contestants(network, threads)]
        if with_torch:
            sources.append(torch_contestants(network, threads))
        for source in sources:
            try:
                for name, agreement, run in source:
                    start = time.perf_counter()
                    run()
                    seconds = time.perf_counter() - start
                    if seconds > SLOWEST:
                        print(f"{network.name}: {name} left out: one run takes {seconds:.1f} s", file=sys.stderr)
                        continue
                    yield {"shape": network.name, "threads": threads, "what": name, "macs": network.macs,
                           "batch": network.batch, "agreement": agreement, "seconds": float("inf"), "run": run}
            except (RuntimeError, NotImplementedError) as error:
                print(f"{network.name}: left out: {str(error).splitlines()[0]}", file=sys.stderr)


def measure(group, threads, seconds, with_torch):
    """The fastest repetition of each contestant, and of those measured before."""
    if with_torch:
        import torch

        torch.set_num_threads(threads)
    for contestant in group:
        end = time.perf_counter() + seconds
        while (start := time.perf_counter()) < end:
            contestant["run"]()
            contestant["seconds"] = min(contestant["seconds"], time.perf_counter() - start)


def main():
    arguments = parse()
    with_torch = not arguments.no_torch
    enter(arguments.venv, ["numpy", "onnx", "onnxruntime"], with_torch)
    import numpy
    import onnxruntime

    modules = [numpy, onnxruntime]
    if with_torch:
        try:
            import torch

            modules.append(torch)
        except ImportError:
            print("torch is not there; its figures are left out", file=sys.stderr)
            with_torch = False
    before = conditions(modules)
    folder = TARGET / "versus" / "networks"
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*"):
        old.unlink()
    cargo_bench({"NTMU_EXPORT": str(folder)})
    networks = [Network(folder, path.stem) for path in sorted(folder.glob("*.json"))]
    others = {threads: list(contestants(networks, threads, with_torch)) for threads in arguments.threads}
    # Before and after the engine: whatever else the machine does must last to matter.
    for threads, group in others.items():
        measure(group, threads, arguments.seconds, with_torch)
    cargo_bench()
    for threads, group in others.items():
        measure(group, threads, arguments.seconds, with_torch)
    ours = criterion()
    figures = [{key: value for key, value in c.items() if key != "run"} for group in others.values() for c in group]
    for network in networks:
        for threads in arguments.threads:
            for group, order in [("mlp", "row-major"), ("blocked", "blocked")]:
                found = ours[group, network.name, str(threads)]
                figures.append({"shape": network.name, "threads": threads, "what": f"ntmu {order}",
                                "macs": network.macs, "batch": network.batch, "agreement": None,
                                "seconds": found["fastest"], "mean_seconds": found["mean"]})
    peaks = {}
    for (group, name, _), found in ours.items():
        if group == "peak":
            peaks[name] = max(peaks.get(name, 0), found["elements"] / found["fastest"])
    peak = max(peaks.values(), default=None)
    report(figures, peak)
    engine = [{"group": g, "name": n, "parameter": p, **found} for (g, n, p), found in sorted(ours.items())]
    results = {"conditions": {**before, "load_average_after": os.getloadavg()}, "peak_macs_per_second": peaks,
               "ratios": ratios(figures), "figures": figures, "engine": engine}
    write(arguments.json, results)


def cases(figures):
    """The figures of each network and number of threads."""
    keys = dict.fromkeys((f["shape"], f["threads"]) for f in figures)
    for key in sorted(keys):
        yield key, [f for f in figures if (f["shape"], f["threads"]) == key]


def ratios(figures):
    """How many times as long the fastest form of each other engine takes, by our order of inputs."""
    found = []
    for (shape, threads), of in cases(figures):
        ours = {f["what"].split()[1]: f["seconds"] for f in of if f["what"].startswith("ntmu")}
        for rival in ("onnxruntime", "torch", NO_BIAS):
            theirs = [f for f in of if f["what"].startswith(rival) and (rival == NO_BIAS or f["what"] != NO_BIAS)]
            if theirs:
                best = min(theirs, key=lambda f: f["seconds"])
                times = {order: best["seconds"] / seconds for order, seconds in ours.items()}
                found.append({"shape": shape, "threads": threads, "against": best["what"], **times})
    return found


def report(figures, peak):
    print(f"{'shape':20}{'threads':>8} {'what':28}{'ms':>9}{'Mtexel/s':>10}{'GMAC/s':>9}{'of peak':>9}  codes that differ")
    for (shape, threads), of in cases(figures):
        for f in sorted(of, key=lambda f: f["seconds"]):
            rate = f["batch"] / f["seconds"]
            macs = rate * f["macs"]
            share = f"{macs / (peak * threads):8.1%}" if peak and f["what"].startswith("ntmu") else ""
            agreement = f["agreement"]
            differ = f"{agreement['differ']:.5%}, largest {agreement['largest']}" if agreement else ""
            print(f"{shape:20}{threads:8} {f['what']:28}{f['seconds'] * 1e3:9.3f}{rate / 1e6:10.2f}"
                  f"{macs / 1e9:9.1f}{share:>9}  {differ}")
        print()
    print(f"{'times as long as ntmu':28}{'threads':>8} {'against':28}{'row-major':>11}{'blocked':>9}")
    for r in ratios(figures):
        print(f"{r['shape']:28}{r['threads']:8} {r['against']:28}{r['row-major']:10.2f}x{r['blocked']:8.2f}x")


if __name__ == "__main__":
    main()
