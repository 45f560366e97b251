"""Two-way nearest distances of two curves of 20 000 points: ours beside scipy's cKDTree."""

import numpy as np
from scipy.spatial import cKDTree

from turns import Ours, arguments, in_turns, record, require, save, wall


def main():
    binary, folder, rounds = arguments()
    ours = Ours(binary, "metrics", folder)
    curve, truth = np.load(folder / "curve.npy"), np.load(folder / "truth.npy")

    def both(workers):
        return (
            cKDTree(truth).query(curve, workers=workers)[0],
            cKDTree(curve).query(truth, workers=workers)[0],
        )

    there, back = both(1)
    found = ours.answer("points")[0]
    theirs = np.array([there.mean(), back.mean(), back.max()])
    # The same distances to some roundings of the coordinates; a sum of n of them rounds n times.
    tolerance = np.finfo(float).eps * (16 * np.abs(truth).max() + len(truth) * theirs)
    require("means and maximum", (np.abs(found - theirs) <= tolerance).all())
    segments = ours.answer("segments")
    spacing = max(np.linalg.norm(np.diff(c, axis=0), axis=1).max() for c in (curve, truth))
    points = np.column_stack([there, back])
    # A segment is never farther than its ends, nor nearer than half its length allows.
    slack = 16 * np.finfo(float).eps * np.abs(truth).max()
    require("segments", (segments <= points + slack).all())
    require("segments", (points <= np.hypot(segments, spacing / 2) + slack).all())

    times = in_turns(
        {
            "accurate, to points": ours.timed("points"),
            "accurate, to segments": ours.timed("segments"),
            "scipy cKDTree, to points": wall(lambda: both(1)),
        },
        rounds,
    )
    peer = "scipy cKDTree, to points"
    peers = [
        (peer, "accurate, to points", "same distances"),
        (peer, "accurate, to segments", "ours exact to the segments"),
    ]
    setting = f"{len(curve)} x {len(truth)} points, both ways"
    result = record("metrics", setting, times, peers, ["scipy"])
    ours.close()
    save("metrics", [result])


if __name__ == "__main__":
    main()
