"""Motions between pairs of images by OpenCV, for `cargo xtask limit camera --python`.

Argument: folder with images.bin (bytes, image after image) and index.csv (group, width, height): pairs, then frames of a film.
Writes answers.csv: method, pair, seconds, the nine numbers of the homography from the first to the second (none where there is none);
and method, "film", median seconds a frame. Needs numpy and opencv. One thread. ECC is slow: it gets the first 400 pairs.
"""

import csv
import os
import sys
import time

import cv2
import numpy as np

cv2.setNumThreads(1)
cv2.setRNGSeed(1)
folder = sys.argv[1]
data = np.memmap(os.path.join(folder, "images.bin"), np.uint8, "r")
pairs, film, at = [], [], 0
with open(os.path.join(folder, "index.csv")) as file:
    for group, w, h in csv.reader(file):
        w, h = int(w), int(h)
        image = np.array(data[at : at + w * h]).reshape(h, w)
        at += w * h
        (film if group == "film" else pairs).append(image)
pairs = list(zip(pairs[::2], pairs[1::2]))


def ecc(a, b, start=None, blur=5, rounds=100):
    warp = np.eye(3, dtype=np.float32) if start is None else start
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, rounds, 1e-6)
    return cv2.findTransformECC(a, b, warp, cv2.MOTION_HOMOGRAPHY, criteria, None, blur)[1]


def ecc_levels(a, b):
    """From a quarter of the size on."""
    warp = np.eye(3, dtype=np.float32)
    for k in (4, 2, 1):
        small = [cv2.resize(i, None, fx=1 / k, fy=1 / k, interpolation=cv2.INTER_AREA) for i in (a, b)]
        grow = np.array([[k, 0, 0.5 * (k - 1)], [0, k, 0.5 * (k - 1)], [0, 0, 1]], dtype=np.float32)
        start = (np.linalg.inv(grow) @ warp @ grow).astype(np.float32)
        warp = (grow @ ecc(*small, start / start[2, 2]) @ np.linalg.inv(grow)).astype(np.float32)
    return warp


def orb(a, b):
    detector = cv2.ORB_create(1000)
    (ka, da), (kb, db) = detector.detectAndCompute(a, None), detector.detectAndCompute(b, None)
    matches = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(da, db)
    p, q = np.float32([ka[m.queryIdx].pt for m in matches]), np.float32([kb[m.trainIdx].pt for m in matches])
    return cv2.findHomography(p, q, cv2.RANSAC, 3.0)[0]


def flow(a, b):
    p = cv2.goodFeaturesToTrack(a, 500, 0.01, 7)
    q, ok, _ = cv2.calcOpticalFlowPyrLK(a, b, p, None, winSize=(21, 21), maxLevel=4)
    ok = ok.ravel() == 1
    return cv2.findHomography(p[ok], q[ok], cv2.RANSAC, 1.0)[0]


methods = [
    ("OpenCV ECC, homography", ecc, 400, 5),
    ("OpenCV ECC, three levels", ecc_levels, 400, 5),
    ("OpenCV ORB + RANSAC", orb, len(pairs), len(film)),
    ("OpenCV sparse flow + RANSAC", flow, len(pairs), len(film)),
]


def timed(method, a, b):
    start = time.perf_counter()
    try:
        found = method(a, b)
    except (cv2.error, TypeError):
        found = None
    return found, time.perf_counter() - start


with open(os.path.join(folder, "answers.csv"), "w", newline="") as file:
    out = csv.writer(file)
    for name, method, n_pairs, n_film in methods:
        for k, (a, b) in enumerate(pairs[:n_pairs]):
            found, seconds = timed(method, a, b)
            out.writerow([name, k, seconds] + ([""] if found is None else list(np.ravel(found))))
        times = [timed(method, a, b)[1] for a, b in list(zip(film, film[1:]))[:n_film]]
        out.writerow([name, "film", np.median(times)])
