"""Our program and other people's, in turns on the same arrays.

Two clocks: the processor time of the process (user and system), which other work on the machine does
not stretch, and the time on the wall. Everything runs in one thread, so on a quiet machine they agree;
ratios are those of processor time.
"""

import gc
import importlib.metadata
import json
import os
import platform
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

RESULTS = Path(__file__).resolve().parent / "results"


class Ours:
    """One part of `ours serve`. Calls are timed inside: what comes back is (processor, wall), s."""

    def __init__(self, binary, part, folder):
        self.folder = Path(folder)
        self.process = subprocess.Popen(
            [binary, "serve", part, str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def _ask(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        reply = self.process.stdout.readline()
        if not reply:
            sys.exit(f"our program ended on `{line}`")
        processor, wall = reply.split()
        return int(processor) * 1e-9, int(wall) * 1e-9

    def timed(self, name):
        return lambda: self._ask(name)

    def answer(self, name):
        file = self.folder / f"answer_{name}.npy"
        self._ask(f"{name} {file}")
        return np.load(file)

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def wall(call):
    """The time of a Python call, what the interpreter adds included: (processor, wall), s."""

    def timed():
        processor, wall = time.process_time(), time.perf_counter()
        call()
        return time.process_time() - processor, time.perf_counter() - wall

    return timed


def in_turns(runners, repeats):
    """Medians and least times of each; every round runs each of them once, in order."""
    for run in runners.values():
        run()  # caches, page tables, compilers
    seconds = {name: [] for name in runners}
    gc.disable()
    for _ in range(repeats):
        for name, run in runners.items():
            seconds[name].append(run())
    gc.enable()
    return {name: summary(values) for name, values in seconds.items()}


def summary(values):
    processor, wall = ([1e3 * value[k] for value in values] for k in (0, 1))
    return {
        "processor_median_ms": statistics.median(processor),
        "processor_least_ms": min(processor),
        "wall_median_ms": statistics.median(wall),
        "wall_least_ms": min(wall),
        "runs": len(values),
    }


def processor():
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.processor()


def record(part, setting, times, peers, packages):
    """One setting as it goes to the JSON; prints the ratios.

    `times`: what `in_turns` gave. `peers`: (peer, ours, note) by the names in it.
    """
    comparisons = []
    for peer, ours, note in peers:
        ratios = {
            f"ratio_of_{key}": times[peer][f"{key}_ms"] / times[ours][f"{key}_ms"]
            for key in ("processor_median", "processor_least", "wall_least")
        }
        comparisons.append({"peer": peer, "ours": ours, "note": note, **ratios})
        print(
            f"{setting}: {peer} {times[peer]['processor_median_ms']:.3f} ms, "
            f"{ours} {times[ours]['processor_median_ms']:.3f} ms: "
            f"{ratios['ratio_of_processor_median']:.1f} x",
            flush=True,
        )
    return {
        "part": part,
        "setting": setting,
        "comparisons": comparisons,
        "times": times,
        "versions": {name: importlib.metadata.version(name) for name in ["numpy", *packages]},
        "python": platform.python_version(),
        "processor": processor(),
        "load_average": os.getloadavg()[0],
    }


def save(part, results):
    RESULTS.mkdir(exist_ok=True)
    file = RESULTS / f"{part}.json"
    temporary = file.with_suffix(".tmp")
    temporary.write_text(json.dumps(results, indent=1) + "\n")
    temporary.replace(file)


def arguments():
    """Our program, the folder of arrays, the number of rounds."""
    if len(sys.argv) != 4:
        sys.exit(f"usage: {sys.argv[0]} OURS FOLDER ROUNDS")
    return sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])


def require(what, holds):
    """Timing an answer that is wrong proves nothing."""
    if not holds:
        sys.exit(f"answers differ: {what}")
