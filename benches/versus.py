#!/usr/bin/env python3
"""The engine beside ONNX Runtime and PyTorch: same networks, same texels, same threads, one run.

    python3 benches/versus.py [--rounds N] [--no-torch] [--venv DIR] [--json FILE]

Makes a virtual environment with onnxruntime, onnx, numpy and (unless --no-torch; its wheel brings
gigabytes of CUDA libraries that are not used) torch, exports the networks and a batch of inputs
from the engine's own benchmark, and measures. Every figure is the best of many repetitions, and the
repetitions of all contestants take turns. ONNX Runtime computes each network in every int8 form that
it has, and the fastest of them counts. Both round to nearest, ONNX Runtime in f32 with ties to even,
the engine exactly with ties up; the share of codes that differ and the largest difference are printed.
A difference of 1 in one layer may grow in those behind it.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def own_environment(arguments):
    """Runs this script again inside the virtual environment, which is made first if need be."""
    venv = Path(arguments.venv)
    python = venv / "bin" / "python3"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(venv)], check=True)
    wanted = ["numpy", "onnx", "onnxruntime"] + ([] if arguments.no_torch else ["torch"])
    have = subprocess.run([python, "-m", "pip", "list", "--format=json"], check=True, capture_output=True)
    have = {package["name"] for package in json.loads(have.stdout)}
    missing = [name for name in wanted if name not in have]
    if missing:
        print("installing", *missing, "into", venv, file=sys.stderr)
        subprocess.run([python, "-m", "pip", "install", "-q", *missing], check=True)
    os.environ["NTMU_VERSUS"] = "1"
    os.execv(python, [str(python), *sys.argv])


def parse():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=60, help="repetitions of every figure")
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--no-torch", action="store_true", help="leave PyTorch out")
    parser.add_argument("--venv", default=str(Path.home() / ".cache" / "ntmu-versus"))
    parser.add_argument("--json", help="write the figures to this file")
    return parser.parse_args()


def cargo_bench(*words):
    command = ["cargo", "bench", "-q", "-p", "ntmu-model", "--bench", "engine", "--", *words]
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout


class Network:
    """One exported network with its batch, as NumPy arrays."""

    def __init__(self, folder, name):
        import numpy as np

        data = json.loads((folder / f"{name}.json").read_text())
        self.name = name
        self.batch = data["batch"]
        self.layers = data["layers"]
        for layer in self.layers:
            shape = (layer["outputs"], layer["inputs"])
            layer["weights"] = np.array(layer["weights"], np.int8).reshape(shape)
            layer["bias"] = np.array(layer["bias"], np.int32)
            layer["scales"] = np.array(layer["scales"], np.float64)
        inputs = self.layers[0]["inputs"]
        self.inputs = np.fromfile(folder / f"{name}.inputs", np.int8).reshape(self.batch, inputs)
        self.codes = np.fromfile(folder / f"{name}.codes", np.uint8).reshape(self.batch, -1)
        self.macs = sum(layer["inputs"] * layer["outputs"] for layer in self.layers)


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


FORMS = ["QGemm", "QDQ", "MatMulInteger", "QLinearMatMul"]


def onnx_contestants(network, threads):
    import numpy as np
    import onnxruntime

    x = (network.inputs.astype(np.int16) + 128).astype(np.uint8)
    for form in FORMS:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        options.log_severity_level = 3
        session = onnxruntime.InferenceSession(onnx_model(network, form), options, ["CPUExecutionProvider"])
        codes = session.run(None, {"x": x})[0].astype(np.int16)
        agreement = None
        if form != "QLinearMatMul":
            apart = np.abs(codes - network.codes.astype(np.int16))
            agreement = {"differ": float((apart > 0).mean()), "largest": int(apart.max())}
        yield f"onnxruntime {form}", agreement, (lambda session=session: session.run(None, {"x": x}))


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

    for name, dtype in [("f32", torch.float32), ("bf16", torch.bfloat16), ("f16", torch.float16)]:
        weights = [torch.tensor(layer["weights"].astype(np.float32) / 1024).to(dtype) for layer in network.layers]
        bias = [torch.zeros(layer["outputs"], dtype=dtype) for layer in network.layers]
        x = torch.tensor(network.inputs.astype(np.float32) / 128).to(dtype)
        last = len(weights) - 1

        def linear(index, x, weights=weights, bias=bias):
            y = torch.nn.functional.linear(x, weights[index], bias[index])
            return y if index == last else torch.relu_(y)

        def run(x=x, linear=linear):
            with torch.inference_mode():
                blocks(x, linear, torch.add)

        yield f"torch {name}", None, run

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


def main():
    arguments = parse()
    if "NTMU_VERSUS" not in os.environ:
        own_environment(arguments)
    folder = ROOT / "target" / "versus"
    folder.mkdir(parents=True, exist_ok=True)
    cargo_bench("--export", str(folder))
    networks = [Network(folder, path.stem) for path in sorted(folder.glob("*.json"))]
    figures = []
    for threads in arguments.threads:
        contestants = []
        for network in networks:
            sources = list(onnx_contestants(network, threads))
            if not arguments.no_torch:
                sources += list(torch_contestants(network, threads))
            for name, agreement, run in sources:
                contestants.append({"shape": network.name, "threads": threads, "what": name, "macs": network.macs,
                                    "batch": network.batch, "agreement": agreement, "seconds": float("inf"), "run": run})
        # The engine is measured before and after: whatever else the machine does must last to matter.
        half = str(max(arguments.rounds // 2, 1))
        engine = [json.loads(cargo_bench("--rounds", half, "--only", '"what":"mlp"', f'"threads":{threads}'))]
        for _ in range(arguments.rounds):
            for contestant in contestants:
                start = time.perf_counter()
                contestant["run"]()
                contestant["seconds"] = min(contestant["seconds"], time.perf_counter() - start)
        engine.append(json.loads(cargo_bench("--rounds", half, "--only", '"what":"mlp"', f'"threads":{threads}')))
        best = {}
        for figure in (f for half in engine for f in half["figures"]):
            key = (figure["shape"], "ntmu " + figure["path"])
            best[key] = min(best.get(key, float("inf")), figure["seconds"])
        for (shape, what), seconds in best.items():
            network = next(n for n in networks if n.name == shape)
            figures.append({"shape": shape, "threads": threads, "what": what, "macs": network.macs,
                            "batch": network.batch, "agreement": None, "seconds": seconds})
        for contestant in contestants:
            del contestant["run"]
            figures.append(contestant)
    report(figures)
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(figures, indent=1) + "\n")


def report(figures):
    print(f"{'shape':14}{'threads':>8} {'what':28}{'ms':>9}{'Mtexel/s':>10}{'GMAC/s':>9}{'ntmu is':>9}  codes that differ")
    for shape in dict.fromkeys(f["shape"] for f in figures):
        for threads in dict.fromkeys(f["threads"] for f in figures):
            of = [f for f in figures if (f["shape"], f["threads"]) == (shape, threads)]
            of.sort(key=lambda f: f["seconds"])
            ours = min((f["seconds"] for f in of if f["what"].startswith("ntmu")), default=float("nan"))
            for f in of:
                rate = f["batch"] / f["seconds"]
                agreement = f["agreement"]
                differ = f"{agreement['differ']:.5%}, largest {agreement['largest']}" if agreement else ""
                print(f"{shape:14}{threads:8} {f['what']:28}{f['seconds'] * 1e3:9.3f}{rate / 1e6:10.2f}"
                      f"{rate * f['macs'] / 1e9:9.1f}{f['seconds'] / ours:8.2f}x  {differ}")
            print()


if __name__ == "__main__":
    main()
