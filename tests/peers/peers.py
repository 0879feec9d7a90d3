#!/usr/bin/env python3
"""Ratios of other programs' times to ours, in one interleaved run on one core.

    python3 tests/peers/peers.py [--core N] [--only TEXT] [--out FOLDER]

Makes target/peers-venv with what requirements.txt names (needs the network once), builds our side
(ours.rs), and asks both in turn. README.md says what is measured and how.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
VENV = ROOT / "target" / "peers-venv"
ONE_THREAD = {name: "1" for name in ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}


def in_our_environment():
    """Run again by the environment's Python, unless this is it."""
    if pathlib.Path(sys.prefix).resolve() == VENV.resolve():
        return
    python = VENV / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", VENV], check=True)
    install = ["-m", "pip", "install", "-q", "--disable-pip-version-check", "-r", HERE / "requirements.txt"]
    subprocess.run([python, *install], check=True)
    os.execve(python, [str(python), *sys.argv], {**os.environ, **ONE_THREAD})


def build():
    """Our side, and where it lies."""
    command = ["cargo", "build", "-q", "--release", "--locked", "-p", "system-tests", "--example", "ours"]
    subprocess.run(command, cwd=ROOT, check=True)
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return target / "release" / "examples" / "ours"


class Ours:
    """Our kernels, asked over a pipe (ours.rs says how)."""

    def __init__(self, program):
        self.process = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def ask(self, question):
        self.process.stdin.write(question.encode() + b"\n")
        self.process.stdin.flush()
        line = self.process.stdout.readline()
        if not line:
            sys.exit(f"our side ended at the question: {question}")
        header = json.loads(line)
        return header, self.process.stdout.read(header["bytes"])

    def names(self, what):
        return self.ask(what)[0]["names"]

    def image(self, name):
        header, data = self.ask(f"image {name}")
        shape = (3, header["height"], header["width"])
        left, right, mask = np.frombuffer(data, np.uint8).reshape(shape)
        return Image(name, left, right, mask)

    def best(self, kernel, budget, image):
        """Seconds of the best run, and what it made."""
        header, made = self.ask(f"time {kernel} {int(budget * 1e6)} {image.name}")
        return header["ns"] / 1e9, made


class Image:
    def __init__(self, name, left, right, mask):
        self.name, self.left, self.right, self.mask = name, left, right, mask


def best(work, budget):
    """As `Ours.best`, of a function."""
    start = time.perf_counter()
    least = float("inf")
    while True:
        begun = time.perf_counter()
        made = work()
        end = time.perf_counter()
        least = min(least, end - begun)
        if end - start >= budget:
            return least, made


# What the others do with an image, and whether what we made is the same.


def thinning(kind):
    return lambda image: lambda: cv2.ximgproc.thinning(image.mask, thinningType=kind)


def same_pixels(_image, theirs, ours):
    return np.array_equal(theirs.ravel(), np.frombuffer(ours, np.uint8))


def euclidean_skeleton(image):
    mask = dip.Image(image.mask) > 0
    return lambda: dip.EuclideanSkeleton(mask)


def keeps_the_topology(image, _theirs, ours):
    """Another rule than the peer's: within the mask, with its components and holes."""
    skeleton = np.frombuffer(ours, np.uint8).reshape(image.mask.shape)
    if np.any(skeleton & ~image.mask):
        return False
    return pieces_and_holes(image.mask) == pieces_and_holes(skeleton)


def pieces_and_holes(mask):
    pieces = cv2.connectedComponents(mask, connectivity=8)[0]
    holes = cv2.connectedComponents(cv2.copyMakeBorder(255 - mask, 1, 1, 1, 1, 0, value=255), connectivity=4)[0]
    return pieces, holes


def precise_distance(image):
    return lambda: cv2.distanceTransform(image.mask, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)


def same_distances(_image, theirs, ours):
    return np.allclose(np.square(theirs, dtype=np.float64).ravel(), np.frombuffer(ours, np.uint32), rtol=1e-5)


def edt_package(image):
    return lambda: edt.edtsq(image.mask, black_border=True, parallel=1)


def same_squares(_image, theirs, ours):
    return np.array_equal(theirs.ravel(), np.frombuffer(ours, np.uint32))


def otsu(image):
    return lambda: cv2.threshold(image.left, 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)[1]


def erosion(image):
    square = np.ones((3, 3), np.uint8)
    return lambda: cv2.subtract(image.mask, cv2.erode(image.mask, square))


def contour_hull(image):
    def work():
        outlines, _ = cv2.findContours(image.mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        return cv2.convexHull(outlines[0])

    return work


def same_polygon(_image, theirs, ours):
    ours = np.frombuffer(ours, np.int32).reshape(-1, 1, 2) // 256
    corners = lambda polygon: {tuple(corner) for [corner] in polygon.tolist()}
    # Theirs may keep a corner on a straight side; the area tells.
    return corners(ours) <= corners(theirs) and cv2.contourArea(ours) == cv2.contourArea(theirs)


def block_matching(image):
    matcher = cv2.StereoSGBM.create(minDisparity=0, numDisparities=64, blockSize=5)
    return lambda: matcher.compute(image.left, image.right)


def points_in_space(image):
    disparities = block_matching(image)
    height, width = image.left.shape
    focal, baseline = 750 * width / 640, 60
    q = np.float32([[1, 0, 0, -width / 2], [0, 1, 0, -height / 2], [0, 0, 0, focal], [0, 0, 1 / baseline, 0]])
    return lambda: cv2.reprojectImageTo3D(disparities().astype(np.float32) / 16, q)


class Row:
    """Something that others do too."""

    def __init__(self, what, theirs, ours, images, goals, same=None, published=False):
        """`goals` by the kernel's variant; `images` chooses by name."""
        self.what, self.theirs, self.ours, self.images = what, theirs, ours, images
        self.goals, self.same, self.published = goals, same, published


def everything(_name):
    return True


def at_640x480(name):
    return name.endswith("640x480")


def rows():
    zhang_suen, guo_hall = cv2.ximgproc.THINNING_ZHANGSUEN, cv2.ximgproc.THINNING_GUOHALL
    thebe = {"u64": 25, "avx2": 70, "avx512": 70}
    return [
        Row("Zhang-Suen / OpenCV ximgproc", thinning(zhang_suen), "zhang_suen", everything,
            {"u64": 250, "avx2": 700, "avx512": 1000}, same_pixels, published="Zhang-Suen / THeBE's best"),
        Row("Guo-Hall / OpenCV ximgproc", thinning(guo_hall), "guo_hall", everything,
            {"u64": 230, "avx2": 550, "avx512": 900}, same_pixels),
        Row("EDT-ordered thinning / DIPlib EuclideanSkeleton", euclidean_skeleton, "edt_ordered", at_640x480,
            {"": 8}, keeps_the_topology),
        Row("exact EDT / OpenCV PRECISE", precise_distance, "squared_distance", everything, {"": 6}, same_distances),
        Row("exact EDT / edt", edt_package, "squared_distance", everything, {}, same_squares),
        Row("Otsu and binarise / OpenCV threshold", otsu, "otsu_binarise", everything, {}, same_pixels),
        Row("boundary / OpenCV erode and subtract", erosion, "boundary", everything, {"": 2.5}, same_pixels),
        Row("hull / OpenCV findContours and convexHull", contour_hull, "hull", everything, {"": 6}, same_polygon),
        Row("described shape / OpenCV SGBM, 64 disparities", block_matching, "shape", at_640x480,
            {"full": 10, "device": 10}),
        Row("mesh on disk / OpenCV SGBM and reprojectImageTo3D", points_in_space, "mesh", at_640x480, {"": 1}),
        # As true as each other, see `surface_of_balls`.
        Row("500 balls to a mesh at 128^3 (65,858 vertices, 0.076 cells rms off) / dense distances and "
            "fast-surface-nets (69,176 vertices, 0.077 cells rms off)", None, "balls_to_mesh",
            lambda name: name == "ring 640x480", {"": 4}),
    ], thebe


BUDGET = 0.02
"""Seconds that each side repeats a short run for."""
FEWEST, MOST = 3, 15
"""Rounds; two where one side takes more than half a second."""
ALL_ROUNDS = 1.0
"""Seconds that the slower side may take in all rounds of an image, if that is more than the fewest."""


def measure(ours, row, kernels, image):
    """Of each kernel, the median over the rounds of peer's time / ours; and the median of both times."""
    if row.theirs is None:
        peer = lambda budget: ours.best("surface_nets", budget, image)
    else:
        work = row.theirs(image)
        peer = lambda budget: best(work, budget)
    first, theirs = peer(0)
    longest = first
    for kernel in kernels:
        ours_first, made = ours.best(kernel, 0, image)
        longest = max(longest, ours_first)
        if row.same and not row.same(image, theirs, made):
            sys.exit(f"{kernel} on {image.name}: not what {row.what.split(' / ')[1]} makes")
    rounds = int(min(MOST, max(FEWEST if longest < 0.5 else 2, ALL_ROUNDS / max(longest, BUDGET))))
    times = {kernel: [] for kernel in kernels}
    for _ in range(rounds):
        for kernel in kernels:
            # A long peer is asked once a round, for all kernels.
            if first < 0.5 or kernel == kernels[0]:
                their_time, _ = peer(BUDGET)
            our_time, _ = ours.best(kernel, BUDGET, image)
            times[kernel].append((their_time, our_time))
    result = {}
    for kernel, pairs in times.items():
        pairs = np.array(pairs)
        result[kernel] = {
            "ratio": float(np.median(pairs[:, 0] / pairs[:, 1])),
            "theirs_us": float(np.median(pairs[:, 0]) * 1e6),
            "ours_us": float(np.median(pairs[:, 1]) * 1e6),
        }
    return result


def line(what, variant, ratios, goal):
    """A row of the table: the median over the images, the least and the largest."""
    median = float(np.median(ratios))
    verdict = "" if goal is None else "pass" if median >= goal else "FAIL"
    return {"what": what, "variant": variant, "median": median, "least": min(ratios), "largest": max(ratios),
            "images": len(ratios), "goal": goal, "verdict": verdict}


def number(x):
    return f"{x:.0f}" if x >= 100 else f"{x:.1f}" if x >= 10 else f"{x:.2f}"


def markdown(lines):
    head = ["| what / peer | variant | times faster | least to largest | images | goal | |", "|---|---|---|---|---|---|---|"]
    return "\n".join(head + [
        f"| {l['what']} | {l['variant']} | **{number(l['median'])}** | {number(l['least'])} to {number(l['largest'])} "
        f"| {l['images']} | {'' if l['goal'] is None else l['goal']} | {l['verdict']} |" for l in lines]) + "\n"


def progress(text):
    """Where the run is: one line that changes, or, where that is kept, one after the other."""
    if sys.stderr.isatty():
        print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)
    elif text:
        print(text, file=sys.stderr, flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--core", type=int, default=max(os.sched_getaffinity(0)), help="processor to run on")
    parser.add_argument("--only", default="", help="rows whose name contains this")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "target" / "peers", help="folder of the results")
    options = parser.parse_args()

    program = build()
    os.sched_setaffinity(0, {options.core})
    cv2.setNumThreads(1)
    dip.SetNumberOfThreads(1)
    ours = Ours(program)
    all_kernels, names = ours.names("kernels"), ours.names("images")
    table, thebe = rows()
    quotients = {name: times["cv2"] / times["thebe"]
                 for name, times in json.loads((HERE / "published.json").read_text())["thebe"].items()}

    images = {name: ours.image(name) for name in names}
    chosen = [row for row in table if options.only.lower() in row.what.lower()]
    details, lines = [], []
    start = time.monotonic()
    for row in chosen:
        kernels = [name for name in all_kernels if name.split("/")[0] == row.ours]
        ratios = {kernel: {} for kernel in kernels}
        for image in (images[name] for name in names if row.images(name)):
            progress(f"{time.monotonic() - start:4.0f} s  {row.what}: {image.name}")
            for kernel, result in measure(ours, row, kernels, image).items():
                ratios[kernel][image.name] = result["ratio"]
                details.append({"what": row.what, "kernel": kernel, "image": image.name, **result})
        for kernel, by_image in ratios.items():
            variant = kernel.partition("/")[2]
            lines.append(line(row.what, variant, list(by_image.values()), row.goals.get(variant)))
            known = [by_image[name] / quotient for name, quotient in quotients.items() if name in by_image]
            if row.published and known:
                lines.append(line(row.published, variant, known, thebe.get(variant)))
    progress("")
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "peers.json").write_text(json.dumps({"rows": lines, "images": details}, indent=1) + "\n")
    (options.out / "peers.md").write_text(markdown(lines))
    print(markdown(lines))
    print(f"{time.monotonic() - start:.0f} s; {options.out}/peers.json has every image")


if __name__ == "__main__":
    in_our_environment()
    import cv2
    import diplib as dip
    import edt
    import numpy as np

    main()
