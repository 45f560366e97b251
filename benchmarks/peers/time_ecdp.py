"""ECDP: our alignment from pixels to path, beside dynamic time warping of other people.

numba gets the matrix of distances ready-made and traces no path; dtw-python gets it too; dtaidistance
computes its own distances of two series of the same lengths, and traces its path in C.
"""

import numpy as np
from dtaidistance import dtw as dtaidistance
from dtw import dtw
from numba import njit

from turns import Ours, arguments, in_turns, record, require, save, wall


@njit(cache=False, fastmath=False)
def accumulate(cost):
    n, m = cost.shape
    total = np.empty((n, m))
    for i in range(n):
        for j in range(m):
            least = 0.0
            if i > 0 and j > 0:
                least = min(total[i - 1, j], total[i, j - 1], total[i - 1, j - 1])
            elif i > 0:
                least = total[i - 1, j]
            elif j > 0:
                least = total[i, j - 1]
            total[i, j] = cost[i, j] + least
    return total[n - 1, m - 1]


def main():
    binary, folder, rounds = arguments()
    ours = Ours(binary, "ecdp", folder)
    f = np.load(folder / "F.npy")
    results = []
    for n in (1024, 2048):
        p1, p2 = np.load(folder / f"ecdp_{n}_1.npy"), np.load(folder / f"ecdp_{n}_2.npy")
        lines = np.column_stack([p2, np.ones(len(p2))]) @ f.T
        lines /= np.linalg.norm(lines[:, :2], axis=1, keepdims=True)
        cost = np.abs(p1 @ lines[:, :2].T + lines[:, 2])
        series = [np.ascontiguousarray(p[:, 1]) for p in (p1, p2)]

        total = float(ours.answer(f"path_{n}")[0, 0])
        # Distances round at the size of c; so does each of the 2 n partial sums.
        tolerance = 2 * n * np.finfo(float).eps * (16 * np.abs(lines[:, 2]).max() + total)
        require("total cost of numba", abs(accumulate(cost) - total) <= tolerance)
        theirs = dtw(cost, step_pattern="symmetric1").distance
        require("total cost of dtw-python", abs(theirs - total) <= tolerance)

        times = in_turns(
            {
                "accurate": ours.timed(f"path_{n}"),
                "numba loop, no path": wall(lambda: accumulate(cost)),
                "dtaidistance C, with path": wall(lambda: dtaidistance.warping_path_fast(*series)),
                "dtw-python symmetric1, with path": wall(
                    lambda: dtw(cost, step_pattern="symmetric1").index1
                ),
            },
            rounds,
        )
        peers = [
            ("numba loop, no path", "accurate", "distances ready-made, no path"),
            ("dtaidistance C, with path", "accurate", "distances of two series, with path"),
            ("dtw-python symmetric1, with path", "accurate", "distances ready-made, with path"),
        ]
        packages = ["numba", "dtaidistance", "dtw-python"]
        results.append(record("ecdp", f"{n} x {n} points", times, peers, packages))
    ours.close()
    save("ecdp", results)


if __name__ == "__main__":
    main()
