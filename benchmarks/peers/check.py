"""Compares our answers with those of scikit-image, OpenCV, dtw-python and scipy.

Usage: check.py FOLDER, where FOLDER was written by the example `peer_oracle` of `accurate3d`.
Exits non-zero if one answer differs by more than its tolerance.
"""

import json
import sys
from pathlib import Path

import cv2
import numpy as np
from dtw import dtw
from scipy.spatial import cKDTree
from skimage.morphology import skeletonize

EPS = np.finfo(float).eps


def read_csv(path, columns):
    return np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)[:, :columns]


def check_case(folder):
    """Yields (what, largest difference, tolerance)."""
    answers = json.loads((folder / "answers.json").read_text())
    for view in "LR":
        mask = cv2.imread(str(folder / f"mask_{view}.png"), cv2.IMREAD_GRAYSCALE) > 0
        ours = cv2.imread(str(folder / f"thin_{view}.png"), cv2.IMREAD_GRAYSCALE) > 0
        yield f"skimage skeletonize {view}, px", int((skeletonize(mask) != ours).sum()), 0

    p1 = read_csv(folder / "points_L.csv", 2)
    p2 = read_csv(folder / "points_R.csv", 2)
    f = np.loadtxt(folder / "F.txt")
    # OpenCV: x2' F x1 = 0 with image 2 the one of the points; ours is p1' F p2 = 0.
    lines = cv2.computeCorrespondEpilines(p2.reshape(-1, 1, 2), 1, f).reshape(-1, 3)
    ours = np.array(answers["lines_in_view_1"])
    signs = np.sign((lines * ours).sum(axis=1, keepdims=True))
    # c is as large as the image is far: compare the lines where they matter, at the image.
    corners = np.array([[0, 0, 1], [500, 0, 1], [0, 500, 1], [500, 500, 1]]).T
    difference = np.abs((lines * signs - ours) @ corners).max()
    # A line's c is as large as its distance to the corner (0, 0): sums of six roundings of it.
    tolerance = 16 * EPS * max(500.0, np.abs(ours[:, 2]).max())
    yield "OpenCV computeCorrespondEpilines, px", difference, tolerance

    pairs = np.array(answers["pairs"])
    # The least-squares 4-vector depends on the world's origin and unit, up to 0.05 world units on
    # these data. Ours lie midway between the cameras and in the baseline: OpenCV is asked there.
    projections = [np.array(answers[k]) for k in ("P1", "P2")]
    centres = [-np.linalg.solve(p[:, :3], p[:, 3]) for p in projections]
    world_from_ours = np.diag([*[np.linalg.norm(centres[1] - centres[0])] * 3, 1.0])
    world_from_ours[:3, 3] = (centres[0] + centres[1]) / 2
    projections = [p @ world_from_ours for p in projections]
    homogeneous = world_from_ours @ cv2.triangulatePoints(
        *projections, p1[pairs[:, 0]].T, p2[pairs[:, 1]].T
    )
    theirs = (homogeneous[:3] / homogeneous[3]).T
    ours = read_csv(folder / "dlt.csv", 3)
    # Two singular value decompositions of one 4 x 4 matrix, largest over second least singular
    # value below 2 here: tens of roundings of entries below one baseline.
    tolerance = 64 * EPS * np.linalg.norm(centres[1] - centres[0])
    yield "OpenCV triangulatePoints, world units", np.abs(theirs - ours).max(), tolerance

    lines = np.array(answers["lines_in_view_1"])
    cost = np.abs(p1 @ lines[:, :2].T + lines[:, 2])
    theirs = dtw(cost, step_pattern="symmetric1").distance
    # Each of the at most n1 + n2 distances rounds c anew, and so does each partial sum.
    steps = len(p1) + len(p2)
    tolerance = steps * EPS * (16 * max(500.0, np.abs(lines[:, 2]).max()) + theirs)
    yield "dtw-python symmetric1, total cost", abs(theirs - answers["path_cost"]), tolerance

    curve = read_csv(folder / "curve.csv", 3)
    truth = read_csv(folder / "truth.csv", 3)
    to_truth = cKDTree(truth).query(curve)[0]
    to_curve = cKDTree(curve).query(truth)[0]
    for name, value in [
        ("accuracy", to_truth.mean()),
        ("completeness", to_curve.mean()),
        ("max_error", to_curve.max()),
    ]:
        # A coordinate's rounding, 16 times over; the sum of n distances grows it in the worst order.
        tolerance = 16 * EPS * np.abs(truth).max() + len(truth) * EPS * value
        yield f"scipy cKDTree {name}", abs(value - answers[name]), tolerance


def main():
    worst = {}
    folders = sorted(p for p in Path(sys.argv[1]).iterdir() if p.is_dir())
    if not folders:
        sys.exit("no case to check")
    for folder in folders:
        for what, difference, tolerance in check_case(folder):
            found = (difference > tolerance, difference, tolerance, folder.name)
            worst[what] = max(found, worst.get(what, found))
    failed = 0
    for what, (bad, difference, tolerance, folder) in worst.items():
        failed += bad
        print(f"{'FAIL' if bad else 'ok  '} {what}: {difference:.3g} (tolerance {tolerance:.3g}, {folder})")
    print(f"{len(folders)} cases, {len(worst)} comparisons, {failed} failed")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
