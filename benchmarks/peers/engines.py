"""The engines of `accurate segment` against ONNX Runtime itself, on the same image and threads.

    benchmarks/peers/engines.py MODEL.accmodel [--threads 2] [--side 512] [--runs 5]

Prints user CPU seconds of one run of the network: Python's `onnxruntime`, then `accurate` with `ort`
and with `rten`. For `accurate` it is the difference between segmenting many images and one, so that
start-up and loading the model do not count, but reading, normalising, post-processing and writing do.
Needs `onnxruntime` and `numpy`, and `accurate` on PATH or in ACCURATE.
"""

import argparse
import json
import os
import resource
import struct
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path

import numpy as np
import onnxruntime

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("model", type=Path)
parser.add_argument("--threads", type=int, default=2)
parser.add_argument("--side", type=int, default=512)
parser.add_argument("--runs", type=int, default=5)
args = parser.parse_args()
program = os.environ.get("ACCURATE", "accurate")

# The bundle's layout: accurate_seg::network::ModelBundle.
data = args.model.read_bytes()
assert data[:8] == b"ACCMODEL", "not a model"
_, manifest_length, network_length = struct.unpack("<IIQ", data[8:24])
manifest = json.loads(data[56 : 56 + manifest_length])
network = data[56 + manifest_length :]
assert len(network) == network_length

rng = np.random.default_rng(7)
rows, columns = np.mgrid[: args.side, : args.side]
image = 150 + 0.1 * columns + rng.normal(0, 6, (args.side, args.side))
image[np.abs(rows - args.side / 2 - 60 * np.sin(columns / 40)) < 1.6] -= 70
image = image.clip(0, 255).astype(np.uint8)


def png(path):
    def chunk(kind, body):
        crc = zlib.crc32(kind + body)
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", crc)

    lines = b"".join(b"\0" + line.tobytes() for line in image)
    header = struct.pack(">IIBBBBB", args.side, args.side, 8, 0, 0, 0, 0)
    parts = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(lines)) + chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + parts)


def user(who):
    return resource.getrusage(who).ru_utime


options = onnxruntime.SessionOptions()
options.intra_op_num_threads = args.threads
options.add_session_config_entry("session.intra_op.allow_spinning", "0")
session = onnxruntime.InferenceSession(network, options, providers=["CPUExecutionProvider"])
grey = image.astype(np.float64)
tensor = ((grey - grey.mean()) / grey.std()).astype(np.float32)[None, None]
session.run(None, {manifest["network"]["input"]: tensor})
before = user(resource.RUSAGE_SELF)
for _ in range(args.runs):
    session.run(None, {manifest["network"]["input"]: tensor})
peer = (user(resource.RUSAGE_SELF) - before) / args.runs
print(f"onnxruntime {onnxruntime.__version__} (Python): {peer:.3f} s")

library = next(Path(onnxruntime.__file__).parent.glob("capi/libonnxruntime.so.*"))
with tempfile.TemporaryDirectory() as folder:
    folder = Path(folder)
    images = [folder / f"image_{k}.png" for k in range(args.runs + 1)]
    for path in images:
        png(path)
    for engine in ("ort", "rten"):

        def seconds(paths):
            before = user(resource.RUSAGE_CHILDREN)
            command = [program, "-q", "--threads", str(args.threads), "segment", *map(str, paths)]
            command += ["--model", str(args.model), "--engine", engine, "-o", str(folder / "out")]
            command += ["--onnxruntime", str(library)]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            return user(resource.RUSAGE_CHILDREN) - before

        ours = (seconds(images) - seconds(images[:1])) / args.runs
        peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
        print(f"accurate, {engine}: {ours:.3f} s, {ours / peer:.2f} x; peak so far {peak:.0f} MiB")
sys.exit(0)
