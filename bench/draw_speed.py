"""Times `turnaround draw` against Blender on the same model and views, in one run.

    cargo build --release
    python3 bench/draw_speed.py MODEL.obj [--views 24] [--runs 3]

Needs Blender with Freestyle (Debian: apt-get install blender). Ours is the whole command, from
reading the model to the last file written; Blender's is only the rendering of the views, without
its start, its import and the halving of its pictures. Prints a table and Blender's figures.
"""

import argparse
import json
import os
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
OURS = HERE.parent / "target" / "release" / "turnaround"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("--views", type=int, default=24, help="evenly about the whole turn")
    parser.add_argument("--runs", type=int, default=3, help="of ours; the median counts")
    parser.add_argument("--turnaround", type=Path, default=OURS)
    arguments = parser.parse_args()
    azimuths = [f"{360 * view / arguments.views:g}" for view in range(arguments.views)]
    ours = [time_ours(arguments, azimuths) for _ in range(arguments.runs)]
    theirs = time_blender(arguments.model, azimuths)
    median = statistics.median(ours)
    print(f"{len(azimuths)} views of {arguments.model.parent.name}/{arguments.model.name}, "
          f"{os.cpu_count()} processors, load before {os.getloadavg()[0]:.1f}")
    print("| | seconds |")
    print("|---|---|")
    print(f"| turnaround draw, everything | {median:.2f} (of {', '.join(f'{s:.2f}' for s in ours)}) |")
    print(f"| Blender {theirs['blender']}, rendering alone | {theirs['render_s']:.2f} |")
    print(f"| ratio | 1 to {theirs['render_s'] / median:.1f} |")
    print(json.dumps(theirs))


def time_ours(arguments: argparse.Namespace, azimuths: list[str]) -> float:
    with tempfile.TemporaryDirectory() as folder:
        command = [arguments.turnaround, "draw", arguments.model, "--azimuths", ",".join(azimuths),
                   "-o", folder]
        begun = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True)
        return time.perf_counter() - begun


def time_blender(model: Path, azimuths: list[str]) -> dict:
    with tempfile.TemporaryDirectory() as folder:
        command = ["blender", "-b", "--factory-startup", "--python-exit-code", "1", "--python",
                   HERE / "blender_sheet.py", "--", model, folder, *azimuths]
        printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        made = {path.suffix for path in Path(folder).iterdir()}
        assert made == {".png", ".exr"}, f"Blender made {made}"
    figures = next(line for line in printed.splitlines() if line.startswith("FIGURES "))
    return json.loads(figures.removeprefix("FIGURES "))


main()
