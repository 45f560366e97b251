"""Writes the comparisons of results/*.json into the marked part of docs/speed.md.

Usage: table.py FILE
"""

import json
import sys
from pathlib import Path

from turns import RESULTS

BEGIN = "<!-- peers: written by benchmarks/peers/table.py -->"
END = "<!-- end of peers -->"
PARTS = ["ecdp", "thinning", "triangulation", "metrics"]


def milliseconds(value):
    return f"{value:.2f}" if value < 100 else f"{value:.0f}"


def rows():
    versions, machines = {}, set()
    yield "| what | peer | peer, ms | ours, ms | ratio | of what |"
    yield "|---|---|--:|--:|--:|---|"
    # A part whose file is missing has not been measured since it changed.
    for file in (RESULTS / f"{part}.json" for part in PARTS):
        if not file.exists():
            continue
        part = file.stem
        for result in json.loads(file.read_text()):
            versions.update(result["versions"])
            machines.add(f"{result['processor']}, Python {result['python']}")
            for comparison in result["comparisons"]:
                peer, ours = comparison["peer"], comparison["ours"]
                times = result["times"]
                yield (
                    f"| {part}, {result['setting']} | {peer} "
                    f"| {milliseconds(times[peer]['processor_median_ms'])} "
                    f"| {milliseconds(times[ours]['processor_median_ms'])} ({ours}) "
                    f"| **{comparison['ratio_of_processor_median']:.1f}** | {comparison['note']} |"
                )
    yield ""
    listed = ", ".join(f"{name} {version}" for name, version in sorted(versions.items()))
    yield f"Medians of processor time. {listed}. {'; '.join(sorted(machines))}."


def main():
    file = Path(sys.argv[1])
    text = file.read_text()
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    table = "\n".join(rows())
    file.write_text(f"{before}{BEGIN}\n\n{table}\n\n{END}{after}")


if __name__ == "__main__":
    main()
