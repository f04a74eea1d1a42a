"""Times `turnaround draw` against Blender on the same model and views, in one run.

    cargo build --release
    python3 tools/draw_speed.py MODEL.obj [--views 24] [--runs 3]

Needs Blender with Freestyle (Debian: apt-get install blender). Ours is the whole command, from
reading the model to the last file written; Blender's is only the rendering of the views, without
its start, its import and the halving of its pictures. Prints a table and Blender's figures. On a
busy machine only the processor times mean something.
"""

import argparse
import json
import os
import resource
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
    load = os.getloadavg()[0]
    runs = [time_ours(arguments, azimuths) for _ in range(arguments.runs)]
    wall, cpu = (statistics.median(figures) for figures in zip(*runs))
    theirs = time_blender(arguments.model, azimuths)
    their_wall, their_cpu = theirs["render_s"], theirs["render_cpu_s"]
    print(f"{len(azimuths)} views of {arguments.model.parent.name}/{arguments.model.name}, "
          f"{os.cpu_count()} processors, load before {load:.1f}\n")
    print("| | elapsed, s | processor, s |")
    print("|---|---|---|")
    print(f"| turnaround draw, everything, median of {len(runs)} | {wall:.2f} | {cpu:.2f} |")
    print(f"| Blender {theirs['blender']}, rendering alone | {their_wall:.2f} | {their_cpu:.2f} |")
    print(f"| Blender's over ours | {their_wall / wall:.1f} | {their_cpu / cpu:.1f} |\n")
    print(json.dumps({"ours": runs, "theirs": theirs}))


def time_ours(arguments: argparse.Namespace, azimuths: list[str]) -> tuple[float, float]:
    """Elapsed and processor seconds."""
    with tempfile.TemporaryDirectory() as folder:
        command = [arguments.turnaround, "draw", arguments.model, "--azimuths", ",".join(azimuths),
                   "-o", folder]
        begun, begun_cpu = time.perf_counter(), children_cpu()
        subprocess.run(command, check=True, capture_output=True)
        return time.perf_counter() - begun, children_cpu() - begun_cpu


def children_cpu() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


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
