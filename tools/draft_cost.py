"""Time and memory of a draft, by number of views and size of the drawings.

    cargo build --release
    python3 tools/draft_cost.py [--model builtin:dude] [--runs 1] [--set OPTION=VALUE]

Draws one model at each size, subject and strokes growing with it, and reconstructs it from views
spread evenly over 0 to 90 degrees with the default options, from reading the files to the last
artifact written. Prints processor time, elapsed time and peak memory, and how each grows: per
doubling of pixels (2.00 is linear, 2.20 is 10 % above) and from 3 to 19 views. Processor time is
what a busy machine changes least.
"""

import argparse
import math
import os
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

OURS = Path(__file__).resolve().parent.parent / "target" / "release" / "turnaround"
MEGAPIXELS = [0.25, 0.5, 1, 2, 4]
VIEWS = {3: "0:90:45", 5: "0:90:22.5", 9: "0:90:11.25", 19: "0:90:5"}
# Of the sheets that `turnaround draw` makes by default.
WIDTH, HEIGHT, STROKE_PX = 960, 540, 1.5


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--model", default="builtin:dude")
    parser.add_argument("--runs", type=int, default=1, help="of each; the median counts")
    parser.add_argument("--set", action="append", default=[], help="an option of the draft")
    parser.add_argument("--turnaround", type=Path, default=OURS)
    arguments = parser.parse_args()
    print(f"{arguments.model}, {os.cpu_count()} processors, load before {os.getloadavg()[0]:.1f}\n")
    with tempfile.TemporaryDirectory() as folder:
        figures = {(size, views): measure(arguments, size, azimuths, Path(folder))
                   for size in MEGAPIXELS for views, azimuths in VIEWS.items()}
    for title, index, unit in [("Processor time", 1, "s"), ("Elapsed time", 0, "s"), ("Peak memory", 2, "MiB")]:
        table(title, unit, {key: value[index] for key, value in figures.items()})


def measure(arguments: argparse.Namespace, megapixels: float, azimuths: str, folder: Path) -> list[float]:
    scale = math.sqrt(megapixels * 1e6 / (WIDTH * HEIGHT))
    sheet = folder / f"{megapixels}-{azimuths.replace(':', '-')}"
    settings = {"width_px": round(WIDTH * scale), "height_px": round(HEIGHT * scale),
                "line_width_px": round(STROKE_PX * scale, 3)}
    draw = [arguments.turnaround, "draw", arguments.model, "--azimuths", azimuths, "-o", sheet]
    subprocess.run(draw + [part for key, value in settings.items() for part in ("--set", f"{key}={value}")],
                   check=True, capture_output=True)
    # Without the sheet's truth, which would be compared with.
    drawings = {path.stem.removeprefix("view_"): path for path in sorted(sheet.glob("view_*.png"))}
    draft = [arguments.turnaround, "reconstruct", "-o", sheet / "out"]
    draft += [part for azimuth, path in drawings.items() for part in ("--view", f"{azimuth}={path}")]
    draft += [part for option in arguments.set for part in ("--set", option)]
    runs = [run(draft) for _ in range(arguments.runs)]
    return [statistics.median(figures) for figures in zip(*runs)]


def run(command: list) -> tuple[float, float, float]:
    """Elapsed and processor seconds, peak MiB."""
    begun = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        raise SystemExit(f"{' '.join(map(str, command))}: status {status}")
    elapsed = time.perf_counter() - begun
    return elapsed, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def table(title: str, unit: str, figures: dict) -> None:
    views = list(VIEWS)
    print(f"{title}, {unit}\n\n| megapixels | " + " | ".join(f"{count} views" for count in views)
          + " | 19 views over 3 |")
    print("|---|" + "---|" * (len(views) + 1))
    for size in MEGAPIXELS:
        row = [figures[size, count] for count in views]
        cells = [f"{value:.2f}" if unit == "s" else f"{value:.0f}" for value in row]
        print(f"| {size:g} | " + " | ".join(cells) + f" | {row[-1] / row[0]:.2f} |")
    growth = [(figures[MEGAPIXELS[-1], count] / figures[MEGAPIXELS[0], count])
              ** (1 / math.log2(MEGAPIXELS[-1] / MEGAPIXELS[0])) for count in views]
    print("| per doubling | " + " | ".join(f"{value:.2f}" for value in growth) + " | |\n")


if __name__ == "__main__":
    main()
