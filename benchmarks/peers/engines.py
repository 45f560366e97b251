"""The engines of `accurate segment` against ONNX Runtime itself, on the same image and threads.

    benchmarks/peers/engines.py MODEL.accmodel [--threads 2] [--side 512] [--runs 3] [--rounds 5]
        [--json FILE]

Prints user CPU seconds of one run of the network: Python's `onnxruntime`, then `accurate` with `ort`
and with `rten`, in turn, round after round; the medians over the rounds, and the median of each
round's ratio, which is what a loaded machine leaves sound. For `accurate` it is the difference between
segmenting many images and one, so that start-up and loading the model do not count, but reading,
normalising, post-processing and writing do. The peak of memory is that of segmenting one image, start
and model included.
Needs `onnxruntime` and `numpy`, and `accurate` on PATH or in ACCURATE.
"""

import argparse
import json
import os
import resource
import statistics
import struct
import subprocess
import sys
import tempfile
import time
import zlib
from pathlib import Path

import numpy as np
import onnxruntime

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("model", type=Path)
parser.add_argument("--threads", type=int, default=2)
parser.add_argument("--side", type=int, default=512)
parser.add_argument("--runs", type=int, default=3)
parser.add_argument("--rounds", type=int, default=5)
parser.add_argument("--json", type=Path)
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
feed = {manifest["network"]["input"]: tensor}
session.run(None, feed)


def peer_seconds():
    before = user(resource.RUSAGE_SELF)
    for _ in range(args.runs):
        session.run(None, feed)
    return (user(resource.RUSAGE_SELF) - before) / args.runs


library = next(Path(onnxruntime.__file__).parent.glob("capi/libonnxruntime.so.*"))


def run(engine, paths, folder):
    """User seconds and peak memory, MiB, of one process of ours."""
    command = [program, "-q", "--threads", str(args.threads), "segment", "--mirror", "never"]
    command += map(str, paths)
    command += ["--model", str(args.model), "--engine", engine, "-o", str(folder / "out")]
    if engine == "ort":
        command += ["--onnxruntime", str(library)]
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    # The peak that wait4 gives begins with that of this process, which a child of it inherits.
    peak, done = 0.0, 0
    while not done:
        try:
            peak = max(peak, high_water_mib(child.pid))
        except OSError:
            pass
        time.sleep(0.02)
        done, status, usage = os.wait4(child.pid, os.WNOHANG)
    if status:
        sys.exit(f"{' '.join(command)}: status {status}")
    return usage.ru_utime, peak


def high_water_mib(pid):
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    values = [int(line.split()[1]) for line in lines if line.startswith("VmHWM:")]
    return values[0] / 1024 if values else 0.0


def our_seconds(engine, images, folder):
    one, peak = run(engine, images[:1], folder)
    return (run(engine, images, folder)[0] - one) / args.runs, peak


rounds = []
with tempfile.TemporaryDirectory() as folder:
    folder = Path(folder)
    images = [folder / f"image_{k}.png" for k in range(args.runs + 1)]
    for path in images:
        png(path)
    for _ in range(args.rounds):
        found = {"onnxruntime": peer_seconds()}
        for engine in ("ort", "rten"):
            found[engine], found[f"{engine}_peak_mib"] = our_seconds(engine, images, folder)
        rounds.append(found)

result = {
    "model": manifest["name"],
    "onnxruntime_version": onnxruntime.__version__,
    "side_px": args.side,
    "threads": args.threads,
    "rounds": rounds,
    "onnxruntime_s": statistics.median(r["onnxruntime"] for r in rounds),
}
print(f"onnxruntime {onnxruntime.__version__} (Python): {result['onnxruntime_s']:.3f} s")
for engine in ("ort", "rten"):
    seconds = statistics.median(r[engine] for r in rounds)
    ratio = statistics.median(r[engine] / r["onnxruntime"] for r in rounds)
    peak = max(r[f"{engine}_peak_mib"] for r in rounds)
    result |= {f"{engine}_s": seconds, f"{engine}_ratio": ratio, f"{engine}_peak_mib": peak}
    print(f"accurate, {engine}: {seconds:.3f} s, {ratio:.2f} x; peak {peak:.0f} MiB")
if args.json:
    args.json.write_text(json.dumps(result, indent=1) + "\n")
