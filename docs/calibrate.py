#!/usr/bin/env python3
"""Calibrates a stereo camera from pairs that show a chessboard, by OpenCV's own functions.

    pip install opencv-python-headless
    python3 docs/calibrate.py FOLDER COLUMNSxROWS SQUARE_MM [calib.yaml]

FOLDER holds left_*.png and right_*.png, as `host capture --record FOLDER --only-record` leaves them, or folders with
left.png and right.png, as `host device grab` does.
COLUMNSxROWS counts inner corners, where four squares meet: 9x6 for a board of ten by seven squares; one
number even, one odd, so that the board has a top. Writes what `host ... --calib` reads. docs/calibration.md
says how to hold the board.
"""

import sys
from pathlib import Path

import cv2
import numpy as np

MOST_PAIRS = 60  # more than these, evenly chosen, change nothing but the time
LEAST_PAIRS = 8


def corners(path, board):
    """Size of the image, and the board's inner corners in it, px, or None."""
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    if image is None:
        sys.exit(f"cannot read {path}")
    found, points = cv2.findChessboardCornersSB(image, board, flags=cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY)
    return image.shape[::-1], points if found else None


def main(folder, board, square_mm, out="calib.yaml"):
    board = tuple(int(count) for count in board.split("x"))
    grid = np.zeros((board[0] * board[1], 3), np.float32)
    grid[:, :2] = np.mgrid[: board[0], : board[1]].T.reshape(-1, 2) * float(square_mm)

    lefts = sorted(Path(folder).rglob("left*.png"))
    lefts = lefts[:: max(1, -(-len(lefts) // MOST_PAIRS))]
    views, size = [], None
    for left in lefts:
        (size, a), (_, b) = (corners(p, board) for p in (left, left.with_name(left.name.replace("left", "right"))))
        if a is not None and b is not None:
            views.append((a, b))
    if len(views) < LEAST_PAIRS:
        sys.exit(f"the whole board is seen by both eyes in {len(views)} of {len(lefts)} pairs; {LEAST_PAIRS} are needed")

    objects = [grid] * len(views)
    left, right = ([view[eye] for view in views] for eye in (0, 1))
    rms_left, m1, d1, _, _ = cv2.calibrateCamera(objects, left, size, None, None)
    rms_right, m2, d2, _, _ = cv2.calibrateCamera(objects, right, size, None, None)
    rms, m1, d1, m2, d2, r, t, _, _ = cv2.stereoCalibrate(
        objects, left, right, m1, d1, m2, d2, size,
        criteria=(cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 200, 1e-9), flags=cv2.CALIB_USE_INTRINSIC_GUESS,
    )

    file = cv2.FileStorage(out, cv2.FileStorage_WRITE)
    for name, value in [("image_width", size[0]), ("image_height", size[1]), ("M1", m1), ("D1", d1),
                        ("M2", m2), ("D2", d2), ("R", r), ("T", t)]:
        file.write(name, value)
    file.release()
    print(f"{len(views)} pairs, baseline {np.linalg.norm(t):.2f} mm")
    print(f"corners off by {rms_left:.3f} px left, {rms_right:.3f} right, {rms:.3f} together (below 0.5 is good)")


if __name__ == "__main__":
    if len(sys.argv) not in (4, 5):
        sys.exit(__doc__)
    main(*sys.argv[1:])
