#!/usr/bin/env python3
"""Many frames through one process, and a frame larger than memory through a bounded one.

    load.py FATHOM DEMO [--frames 1000] [--frame-program build/bin/stress_frame --size 8192x4320]

DEMO has sequence.####.deep.exr, of which small frames are cut. One `fathom denoise` and one `fathom comp` take all of them: what
memory and open files they hold must not grow. With --frame-program, a frame of 20 samples per pixel is generated, and denoised
and composited within 4 GiB.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

WIDTH, HEIGHT = 48, 32
WARM = 0.1  # of the frames come before memory is compared
MAY_GROW = 2 << 20  # bytes, of the median over a tenth of the frames; allocators and thread pools settle in less
MAY_OPEN = 4  # files at a moment, more than at another: a frame is read, one written, a claim taken at once
MEMORY, MEMORY_BYTES = "4G", 4 << 30
SAMPLES = 20

DENOISE = ["denoise", "--flat-guide", "none"]
COMP = ["comp", "--tidy", "--grade", "gain=2", "--resize", "size=32,24"]


class Failure(Exception):
    pass


def expect(true, text):
    if not true:
        raise Failure(text)


def cut_frames(program, demo, folder, count):
    """Windows of the demo's frames, all of different places."""
    sources = sorted(demo.glob("sequence.*.deep.exr"))
    expect(sources, f"{demo}: no sequence.####.deep.exr")
    for i in range(count):
        x, y = i * 7 % (192 - WIDTH), i * 11 % (108 - HEIGHT)
        box = f"box={x},{y},{WIDTH},{HEIGHT}"
        subprocess.run([program, "crop", sources[i % len(sources)], box, "-o", folder / f"in.{i + 1:04}.exr"], check=True)


def resident(process):
    for line in Path(f"/proc/{process}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return 1024 * int(line.split()[1])
    raise FileNotFoundError  # it has ended


def watch(command, folder, count):
    """Runs `command`, which makes out.####.exr; gives (frames done, bytes, open files) as they were on the way."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=folder)
    seen = []
    while process.poll() is None:
        done = sum(name.startswith("out.") and name.endswith(".exr") for name in os.listdir(folder))
        try:
            seen.append((done, resident(process.pid), len(os.listdir(f"/proc/{process.pid}/fd"))))
        except (FileNotFoundError, ProcessLookupError):
            break
        time.sleep(0.02)
    _, errors = process.communicate()
    expect(process.returncode == 0, f"exit {process.returncode}: {errors[-500:]}")
    made = [folder / f"out.{i + 1:04}.exr" for i in range(count)]
    missing = [path.name for path in made if not path.exists()]
    expect(not missing, f"missing: {missing[:5]}")
    rest = [path.name for path in folder.iterdir() if path.suffix != ".exr"]
    expect(not rest, f"left behind: {rest}")
    return seen


def many_frames(program, words, folder, count):
    """The medians over the tenth of the frames behind the first one, and over the last."""
    for path in folder.glob("out.*.exr"):
        path.unlink()
    seen = watch([program, words[0], "in.####.exr", *words[1:], "-o", "out.####.exr"], folder, count)
    tenth = int(WARM * count)
    early = [sample for sample in seen if tenth <= sample[0] < 2 * tenth]
    late = [sample for sample in seen if sample[0] >= count - tenth]
    expect(early and late, f"seen only {len(seen)} times: too few frames")
    bytes_then, bytes_now = (statistics.median(sample[1] for sample in part) for part in (early, late))
    files_then, files_now = (max(sample[2] for sample in part) for part in (early, late))
    told = f"{bytes_then / 1e6:.1f} to {bytes_now / 1e6:.1f} MB, {files_then} to {files_now} open files"
    expect(bytes_now <= bytes_then + MAY_GROW, f"memory grows: {told}")
    expect(files_now <= files_then + MAY_OPEN, f"open files grow: {told}")
    return told


def bounded(command, folder):
    """Runs `command` and gives its time and the most memory that it held."""
    begin = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=folder)
    errors = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    expect(process.returncode == 0, f"exit {process.returncode}: {errors[-500:]}")
    return time.monotonic() - begin, 1024 * usage.ru_maxrss


def large_frame(program, words, folder):
    out = folder / "large-out.exr"
    seconds, most = bounded([program, words[0], "large.exr", *words[1:], "-o", out.name, "--memory", MEMORY], folder)
    told = f"{seconds:.0f} s, at most {most / (1 << 30):.2f} GiB"
    expect(out.exists(), "no output")
    out.unlink()
    expect(most <= MEMORY_BYTES, told)
    return told


def make_large(frame_program, size, folder):
    width, height = size.split("x")
    bounded([frame_program, "large.exr", width, height, str(SAMPLES)], folder)
    return f"{int(width) * int(height) * SAMPLES / 1e6:.0f} million samples, {(folder / 'large.exr').stat().st_size / 1e9:.1f} GB"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    resolved = lambda path: str(Path(path).resolve())
    parser.add_argument("program", type=resolved)
    parser.add_argument("demo", type=Path)
    parser.add_argument("--frames", type=int, default=1000)
    parser.add_argument("--frame-program", type=resolved)
    parser.add_argument("--size", default="8192x4320")
    options = parser.parse_args()
    passed = failed = 0
    with tempfile.TemporaryDirectory(prefix="fathom-load-") as name:
        folder = Path(name).resolve()
        program, demo, count = options.program, options.demo.resolve(), options.frames
        checks = {
            f"{count} frames cut": lambda: cut_frames(program, demo, folder, count),
            f"{count} frames: denoise": lambda: many_frames(program, DENOISE, folder, count),
            f"{count} frames: comp": lambda: many_frames(program, COMP, folder, count),
        }
        if options.frame_program:
            checks[f"{options.size} made"] = lambda: make_large(options.frame_program, options.size, folder)
            checks[f"{options.size}: denoise"] = lambda: large_frame(program, ["denoise"], folder)
            checks[f"{options.size}: comp"] = lambda: large_frame(program, ["comp", "--clip", "2", "21", "--flatten"], folder)
        for name, check in checks.items():
            try:
                told = check()
                passed += 1
                print(f"ok      {name}{': ' + told if told else ''}", flush=True)
            except (Failure, OSError, subprocess.SubprocessError) as error:
                failed += 1
                print(f"FAILED  {name}: {error}", flush=True)
    print(f"{passed} passed, {failed} failed")
    return 1 if failed or not passed else 0


if __name__ == "__main__":
    sys.exit(main())
