"""Thinning of a wire of 6 px: ours beside scikit-image and OpenCV."""

import cv2
import numpy as np
from skimage.morphology import skeletonize

from turns import Ours, arguments, in_turns, record, require, save, wall


def main():
    binary, folder, rounds = arguments()
    cv2.setNumThreads(1)
    ours = Ours(binary, "thinning", folder)
    results = []
    for side in (512, 1024):
        image = np.load(folder / f"mask_{side}.npy")
        mask = image > 0
        thin = ours.answer(f"zhang_suen_{side}") > 0
        require("skeletonize", np.array_equal(skeletonize(mask), thin))
        thin = ours.answer(f"guo_hall_{side}") > 0
        theirs = cv2.ximgproc.thinning(image, thinningType=cv2.ximgproc.THINNING_GUOHALL) > 0
        # OpenCV leaves the outermost rows and columns as they are.
        require("GUOHALL", np.array_equal(theirs[2:-2, 2:-2], thin[2:-2, 2:-2]))
        zhang_suen, guo_hall = f"accurate Zhang-Suen", "accurate Guo-Hall"
        times = in_turns(
            {
                zhang_suen: ours.timed(f"zhang_suen_{side}"),
                guo_hall: ours.timed(f"guo_hall_{side}"),
                "scikit-image Zhang": wall(lambda: skeletonize(mask)),
                "scikit-image Lee": wall(lambda: skeletonize(mask, method="lee")),
                "OpenCV Zhang-Suen": wall(lambda: cv2.ximgproc.thinning(image)),
                "OpenCV Guo-Hall": wall(
                    lambda: cv2.ximgproc.thinning(
                        image, thinningType=cv2.ximgproc.THINNING_GUOHALL
                    )
                ),
            },
            rounds,
        )
        peers = [
            ("scikit-image Zhang", zhang_suen, "same pixels"),
            ("scikit-image Lee", zhang_suen, "other pixels"),
            ("OpenCV Zhang-Suen", zhang_suen, "other pixels"),
            ("OpenCV Guo-Hall", guo_hall, "same pixels"),
        ]
        packages = ["scikit-image", "opencv-contrib-python-headless"]
        results.append(record("thinning", f"{side} x {side} px", times, peers, packages))
    ours.close()
    save("thinning", results)


if __name__ == "__main__":
    main()
