"""Logits of three balls in PyTorch, for the test of crates/prior.  python reference.py WEIGHTS CENTRE_X CENTRE_Y CENTRE_Z PITCH NX NY NZ

The drawings, their sampling and the places are those of crates/prior/src/tests.rs and sampling.rs; the grid is the one that
the test names when it fails.
"""
import math, sys
import numpy as np, torch
import data, model

SIDE = 96
BALLS = [(0, 0, 30, 14), (0, 4, -8, 22), (26, -6, 2, 9)]
POINTS = [(0, 0, 30), (0, 0, 0), (26, -6, 2), (20, 20, 0), (0, 4, -30), (-15, -15, -8), (10, -14, 2.5), (18, -6, 2)]
SAMPLES = 3


def drawing(azimuth):
    """ink and mask [2,SIDE,SIDE]"""
    row, column = np.mgrid[:SIDE, :SIDE] + .5; ink, mask = np.zeros((2, SIDE, SIDE))
    for x, y, z, radius in BALLS:
        outside = np.hypot(column - (x * math.cos(azimuth) + y * math.sin(azimuth) + SIDE / 2), row - (SIDE / 2 - z)) - radius
        mask = np.maximum(mask, np.clip(.5 - outside, 0, 1)); ink = np.maximum(ink, np.clip(1.5 - np.abs(outside), 0, 1))
    return np.stack([ink, mask])


def taps(count, first, pitch):
    """[count,SIDE]: each output is the mean of a few linear samples"""
    at = first + (np.arange(count)[:, None] + (np.arange(SAMPLES) + .5) / SAMPLES) * pitch - .5
    return (1 - np.abs(at[..., None] - np.arange(SIDE))).clip(0).mean(1)


def main():
    *centre, pitch = [float(x) for x in sys.argv[2:6]]; nx, ny, nz = [int(x) for x in sys.argv[6:9]]
    m = model.load(sys.argv[1]).eval(); azimuths = np.radians([0, 45, 90]); columns, rows = data.width(ny, nx) * data.UP, nz * data.UP; fine = pitch / data.UP
    images = []
    for azimuth in azimuths:
        middle = SIDE / 2 + centre[0] * math.cos(azimuth) + centre[1] * math.sin(azimuth)
        across = taps(columns, middle - columns / 2 * fine, fine); down = taps(rows, SIDE / 2 - centre[2] - rows / 2 * fine, fine)
        images.append(down @ drawing(azimuth) @ across.T)
    images = torch.tensor(np.stack(images)[None], dtype=torch.float32); az = torch.tensor(azimuths[None], dtype=torch.float32)
    with torch.no_grad(): logits = m(images, az, data.hull(images[:, :, 1], az, (nz, ny, nx)), (nz, ny, nx))[0].flip(0)   # rows grow downward
    for point in POINTS:
        at = [(p - c) / (pitch / 2) + n - .5 for p, c, n in zip(point, centre, (nx, ny, nz))]; low = [math.floor(a) for a in at]; total = 0.
        for corner in range(8):
            bits = [corner >> k & 1 for k in range(3)]; weight = math.prod(a - l if b else 1 - a + l for a, l, b in zip(at, low, bits))
            total += weight * float(logits[low[2] + bits[2], low[1] + bits[1], low[0] + bits[0]])
        print(point, round(total, 6))


if __name__ == '__main__':
    main()
