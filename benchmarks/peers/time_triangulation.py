"""Triangulation of 100 000 pairs of whole pixels: ours beside OpenCV."""

import cv2
import numpy as np

from turns import Ours, arguments, in_turns, record, require, save, wall


def main():
    binary, folder, rounds = arguments()
    cv2.setNumThreads(1)
    ours = Ours(binary, "triangulation", folder)
    p1, p2 = np.load(folder / "P1.npy"), np.load(folder / "P2.npy")
    x1, x2 = np.load(folder / "pairs_1.npy"), np.load(folder / "pairs_2.npy")
    columns = [np.ascontiguousarray(x.T) for x in (x1, x2)]

    # The least-squares 4-vector depends on the world's origin and unit. Ours lie midway between the
    # cameras and in the baseline: OpenCV is asked there.
    centres = [-np.linalg.solve(p[:, :3], p[:, 3]) for p in (p1, p2)]
    baseline = np.linalg.norm(centres[1] - centres[0])
    world_from_ours = np.diag([baseline, baseline, baseline, 1.0])
    world_from_ours[:3, 3] = (centres[0] + centres[1]) / 2
    homogeneous = cv2.triangulatePoints(p1 @ world_from_ours, p2 @ world_from_ours, *columns)
    theirs = (world_from_ours @ (homogeneous / homogeneous[3]))[:3].T
    difference = np.abs(theirs - ours.answer("dlt")).max()
    # Two decompositions of one 4 x 4 matrix: some hundred roundings of one baseline.
    require(f"DLT, {difference:.2e}", difference <= 512 * np.finfo(float).eps * baseline)

    def reprojection(points):
        squares = 0.0
        for p, x in ((p1, x1), (p2, x2)):
            h = np.column_stack([points, np.ones(len(points))]) @ p.T
            squares += ((h[:, :2] / h[:, 2:] - x) ** 2).sum(axis=1)
        return np.sqrt(squares.mean() / 4)

    methods = ("lindstrom", "dlt", "midpoint")
    errors = {name: reprojection(ours.answer(name)) for name in methods}
    require("Lindstrom reprojects best", errors["lindstrom"] <= min(errors.values()))
    for name in methods:
        same = np.array_equal(ours.answer(name), ours.answer(f"{name}_into"))
        require(f"{name} into the caller's lists", same)

    # Both ways to call each side: the answer in memory that the call asks for, or in the caller's.
    mine = np.empty_like(homogeneous)
    require("OpenCV writes where it is told", cv2.triangulatePoints(p1, p2, *columns, mine) is mine)
    times = in_turns(
        {
            "accurate Lindstrom": ours.timed("lindstrom"),
            "accurate DLT": ours.timed("dlt"),
            "accurate midpoint": ours.timed("midpoint"),
            "OpenCV triangulatePoints (DLT)": wall(
                lambda: cv2.triangulatePoints(p1, p2, *columns)
            ),
            "accurate Lindstrom, memory used again": ours.timed("lindstrom_into"),
            "accurate DLT, memory used again": ours.timed("dlt_into"),
            "accurate midpoint, memory used again": ours.timed("midpoint_into"),
            "OpenCV triangulatePoints (DLT), memory used again": wall(
                lambda: cv2.triangulatePoints(p1, p2, *columns, mine)
            ),
        },
        rounds,
    )
    peers = [
        (f"OpenCV triangulatePoints (DLT){memory}", f"accurate {method}{memory}", note)
        for memory in ("", ", memory used again")
        for method, note in (
            ("Lindstrom", "ours is the least reprojection error"),
            ("DLT", "the same least squares"),
        )
    ]
    packages = ["opencv-contrib-python-headless"]
    result = record("triangulation", f"{len(x1)} pairs", times, peers, packages)
    result["rms_reprojection_px"] = {**errors, "OpenCV DLT": reprojection(theirs)}
    ours.close()
    save("triangulation", [result])


if __name__ == "__main__":
    main()
