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
    yield "OpenCV computeCorrespondEpilines, px", difference, 1e-6

    pairs = np.array(answers["pairs"])
    projections = [np.array(answers[k]) for k in ("P1", "P2")]
    homogeneous = cv2.triangulatePoints(*projections, p1[pairs[:, 0]].T, p2[pairs[:, 1]].T)
    theirs = (homogeneous[:3] / homogeneous[3]).T
    ours = read_csv(folder / "dlt.csv", 3)
    # Both minimise an algebraic residual, differently scaled, and pixels are rounded: they differ by
    # a fraction of what half a pixel is worth.
    yield "OpenCV triangulatePoints, world units", np.abs(theirs - ours).max(), 2e-2

    cost = np.abs(p1 @ np.array(answers["lines_in_view_1"])[:, :2].T + np.array(answers["lines_in_view_1"])[:, 2])
    theirs = dtw(cost, step_pattern="symmetric1").distance
    yield "dtw-python symmetric1, total cost", abs(theirs - answers["path_cost"]), 1e-6 * theirs

    curve = read_csv(folder / "curve.csv", 3)
    truth = read_csv(folder / "truth.csv", 3)
    to_truth = cKDTree(truth).query(curve)[0]
    to_curve = cKDTree(curve).query(truth)[0]
    for name, value in [
        ("accuracy", to_truth.mean()),
        ("completeness", to_curve.mean()),
        ("max_error", to_curve.max()),
    ]:
        yield f"scipy cKDTree {name}", abs(value - answers[name]), 1e-9


def main():
    worst = {}
    folders = sorted(p for p in Path(sys.argv[1]).iterdir() if p.is_dir())
    if not folders:
        sys.exit("no case to check")
    for folder in folders:
        for what, difference, tolerance in check_case(folder):
            kept = worst.get(what, (0.0, tolerance, ""))
            if difference >= kept[0]:
                worst[what] = (difference, tolerance, folder.name)
    failed = 0
    for what, (difference, tolerance, folder) in worst.items():
        bad = difference > tolerance
        failed += bad
        print(f"{'FAIL' if bad else 'ok  '} {what}: {difference:.3g} (tolerance {tolerance:.3g}, {folder})")
    print(f"{len(folders)} cases, {len(worst)} comparisons, {failed} failed")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
