#!/usr/bin/env python3
"""Kills, interrupts and starves `fathom denoise` and `fathom comp` on a sequence, and looks what they leave.

    faults.py FATHOM FOLDER [--kills 100] [--seed 1]

FOLDER has sequence.####.deep.exr. Nothing may be lost, half written or written twice: at any moment an output is there with
the bytes of a run that nothing disturbed, or it is not there.
"""

import argparse
import contextlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

DENOISE = ["denoise", "--quality", "fast", "--flat-guide", "none"]
COMP = ["comp", "--tidy", "--grade", "gain=2"]


class Failure(Exception):
    pass


class Skip(Exception):
    """This machine or user cannot make the fault."""


def expect(true, text):
    if not true:
        raise Failure(text)


class Lab:
    """A program, the frames that it is given, and what it makes of them where nothing happens. Each check works in a folder
    with `frames` and `out` in it, since a chain's outputs tell the names in the chain."""

    def __init__(self, program, frames, folder):
        self.program, self.frames, self.folder = program, frames, folder
        self.calm, self.seconds = {}, {}
        for words in (DENOISE, COMP):
            out = self.fresh(f"calm-{words[0]}")
            begin = time.monotonic()
            self.run(words, out)
            self.seconds[words[0]] = time.monotonic() - begin
            self.calm[words[0]] = {path.name: path.read_bytes() for path in sorted(out.iterdir())}
            expect(self.calm[words[0]], f"{words[0]} made nothing")

    def start(self, words, out, more=(), **settings):
        """`words` over all frames; `out` is what `fresh` gave."""
        command = [self.program, words[0], "frames/sequence.####.deep.exr", *words[1:], "-o", f"{out.name}/o.####.exr", *more]
        pipe = subprocess.PIPE
        return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, cwd=out.parent, **settings)

    def run(self, words, out, code=0, **settings):
        process = self.start(words, out, **settings)
        _, errors = process.communicate(timeout=600)
        expect(process.returncode == code, f"{words[0]}: expected exit {code}, found {process.returncode}: {errors[-500:]}")
        return errors

    def check(self, words, out, whole=True, only=None):
        """Outputs are calm ones, all of them if `whole`, and nothing else lies there once no process is left."""
        calm = self.calm[words[0]]
        found = {path.name: path.read_bytes() for path in out.iterdir() if path.suffix == ".exr"}
        for name, data in found.items():
            expect(data == calm[name], f"{out / name}: other bytes than of an undisturbed run")
        if whole:
            expect(sorted(found) == sorted(only or calm), f"{out}: expected {sorted(only or calm)}, found {sorted(found)}")
            rest = sorted(path.name for path in out.iterdir() if path.suffix != ".exr")
            expect(not rest, f"{out}: left behind: {rest}")

    def fresh(self, name, copied=False):
        """An empty folder for outputs, beside the frames or copies of them."""
        place = self.folder / name
        shutil.rmtree(place, ignore_errors=True)
        out, frames = place / "out", place / "frames"
        out.mkdir(parents=True)
        if copied:
            frames.mkdir()
            for path in sorted(self.frames.glob("sequence.*.deep.exr")):
                shutil.copy(path, frames)
        else:
            frames.symlink_to(self.frames)
        return out


def inputs_of(out):
    return sorted((out.parent / "frames").iterdir())


def one_line(errors, *parts):
    lines = [line for line in errors.splitlines() if line.startswith("fathom: ")]
    expect(len(lines) == 1, f"expected one line of error, found: {errors[-500:]}")
    for part in parts:
        expect(part in lines[0], f"expected {part!r} in the error, found: {lines[0]}")


def killed(lab, words, kills, chance):
    """Killed at random moments and started again, over and over."""
    out = lab.fresh("killed")
    for _ in range(kills):
        process = lab.start(words, out)
        time.sleep(chance.uniform(0, 1.1 * lab.seconds[words[0]]))
        process.send_signal(signal.SIGKILL)
        process.communicate()
        lab.check(words, out, whole=False)
        if len(list(out.glob("*.exr"))) == len(lab.calm[words[0]]):
            out = lab.fresh("killed")
    lab.run(words, out)
    lab.check(words, out)


def shared(lab, words, count):
    """Several processes on one sequence: every frame is made by one of them."""
    out = lab.fresh("shared")
    statistics = [lab.folder / f"shared-{i}.json" for i in range(count)]
    processes = [lab.start(words, out, more=["--stats", str(path)]) for path in statistics]
    for process in processes:
        _, errors = process.communicate()
        expect(process.returncode == 0, f"exit {process.returncode}: {errors[-500:]}")
    made = [frame["status"] for path in statistics for frame in json.loads(path.read_text())["frames"]].count("done")
    expect(made == len(lab.calm[words[0]]), f"expected {len(lab.calm[words[0]])} frames to be made, found {made}")
    lab.check(words, out)


def shared_and_killed(lab, words, chance):
    """One of two is killed; the other, or a third one after it, makes what it had claimed."""
    out = lab.fresh("shared-killed")
    first, second = lab.start(words, out), lab.start(words, out)
    time.sleep(chance.uniform(0.2, 0.7) * lab.seconds[words[0]])
    first.kill()
    first.communicate()
    second.communicate()
    lab.check(words, out, whole=False)
    lab.run(words, out)
    lab.check(words, out)


def interrupted(lab, words):
    out = lab.fresh("interrupted")
    process = lab.start(words, out)
    time.sleep(0.5 * lab.seconds[words[0]])
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    if process.returncode != 0:  # or it was done already
        expect(process.returncode == 130, f"expected exit 130, found {process.returncode}: {errors[-500:]}")
        one_line(errors, "the same command again")
        left = [path.name for path in out.iterdir() if path.suffix != ".exr"]
        expect(not left, f"left behind: {left}")
    lab.check(words, out, whole=False)
    lab.run(words, out)
    lab.check(words, out)


def full_disk(lab, words):
    """Files may not grow beyond half of an output."""
    out = lab.fresh("full")
    most = min(len(data) for data in lab.calm[words[0]].values()) // 2

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))

    errors = lab.run(words, out, code=1, preexec_fn=limit)
    nothing_written(lab, words, out, errors)


def no_folder(lab, words):
    errors = lab.run(words, lab.fresh("none").parent / "no-such-folder", code=1)
    expect("cannot write" in errors and "no-such-folder" in errors, errors[-500:])


def truncated(lab, words):
    """A frame in the middle ends early: it fails, the others are made."""
    out = lab.fresh("truncated", copied=True)
    victim = inputs_of(out)[1]
    victim.write_bytes(victim.read_bytes()[: victim.stat().st_size // 2])
    one_line(lab.run(words, out, code=1), victim.name)
    names = sorted(lab.calm[words[0]])
    lab.check(words, out, only=[name for i, name in enumerate(names) if i != 1])


def vanishing(lab, words, chance):
    """An input is cut short or removed while it is read: an answer or a line of error, never another picture."""
    for shorten in (False, True):
        out = lab.fresh("vanishing", copied=True)
        victim = inputs_of(out)[-1]
        process = lab.start(words, out)
        time.sleep(chance.uniform(0, 0.8) * lab.seconds[words[0]])
        if shorten:
            with open(victim, "r+b") as file:
                file.truncate(victim.stat().st_size // 3)
        else:
            victim.unlink()
        _, errors = process.communicate(timeout=600)
        expect(process.returncode in (0, 1), f"exit {process.returncode}: {errors[-500:]}")
        lab.check(words, out, whole=False)
        rest = [path.name for path in out.iterdir() if path.suffix != ".exr"]
        expect(not rest, f"left behind: {rest}")


def changed(lab, words):
    """An input that changed is not taken for done; the others are."""
    out = lab.fresh("changed", copied=True)
    lab.run(words, out)
    inputs = inputs_of(out)
    shutil.copy(inputs[0], inputs[1])
    again = lab.folder / "changed.json"
    more = ["--stats", str(again), "--overwrite"]
    if words[0] == "denoise":
        one_line(lab.run(words, out, code=1), "--overwrite")
    else:
        more.remove("--overwrite")
    lab.run(words, out, more=more)
    status = [frame["status"] for frame in json.loads(again.read_text())["frames"]]
    expect(status == ["done" if i == 1 else "kept" for i in range(len(inputs))], f"found {status}")


def starved(lab, words):
    out = lab.fresh("starved")
    errors = lab.run(words, out, code=1, more=["--memory", "64K"])
    expect("memory" in errors, f"expected a line about memory, found: {errors[-500:]}")
    left = [path.name for path in out.iterdir()]
    expect(not left, f"left behind: {left}")


def nothing_written(lab, words, out, errors):
    """A line for each frame, and nothing left."""
    lines = [line for line in errors.splitlines() if "cannot write" in line]
    expect(len(lines) == len(lab.calm[words[0]]), f"expected a line for each frame, found: {errors[-500:]}")
    left = [path.name for path in out.iterdir()]
    expect(not left, f"left behind: {left}")


@contextlib.contextmanager
def read_only(folder):
    """Permissions do not bind root, whom only an immutable folder stops."""
    if os.geteuid() != 0:
        folder.chmod(0o555)
    elif subprocess.run(["chattr", "+i", folder], capture_output=True).returncode != 0:
        raise Skip("chattr +i does not work here")
    try:
        yield
    finally:
        if os.geteuid() != 0:
            folder.chmod(0o755)
        else:
            subprocess.run(["chattr", "-i", folder], check=True)


@contextlib.contextmanager
def small_disk(folder, size):
    if subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder], capture_output=True).returncode != 0:
        raise Skip("mount does not work here")
    try:
        yield
    finally:
        subprocess.run(["umount", folder], check=True)


def read_only_folder(lab, words):
    out = lab.fresh("read-only")
    with read_only(out):
        errors = lab.run(words, out, code=1)
    expect("cannot write" in errors, errors[-500:])
    left = [path.name for path in out.iterdir()]
    expect(not left, f"left behind: {left}")


def small_device(lab, words):
    """A disk of its own, of half an output; a quota ends a run in the same place."""
    out = lab.fresh("small")
    with small_disk(out, min(len(data) for data in lab.calm[words[0]].values()) // 2):
        nothing_written(lab, words, out, lab.run(words, out, code=1))


def linked(lab, words):
    """An output that is a symbolic link: the file behind it is written, the link stays."""
    out = lab.fresh("linked")
    elsewhere = out.parent / "elsewhere"
    elsewhere.mkdir()
    name = sorted(lab.calm[words[0]])[0]
    (elsewhere / "image.exr").write_bytes(b"old")
    (out / name).symlink_to("../elsewhere/image.exr")
    lab.run(words, out, more=["--overwrite"])
    lab.check(words, out)
    expect((out / name).is_symlink(), f"{name}: the link is gone")
    left = sorted(path.name for path in elsewhere.iterdir())
    expect(left == ["image.exr"], f"left behind: {left}")


def folder_removed(lab, words, chance):
    """The folder of the outputs goes while they are made: a line for each frame that has no place, or nothing was left to do."""
    out = lab.fresh("removed")
    process = lab.start(words, out)
    time.sleep(chance.uniform(0, 0.9) * lab.seconds[words[0]])
    shutil.rmtree(out, ignore_errors=True)
    _, errors = process.communicate(timeout=600)
    expect(process.returncode in (0, 1), f"exit {process.returncode}: {errors[-500:]}")
    expect(process.returncode == 0 or "cannot write" in errors, errors[-500:])
    out.mkdir(exist_ok=True)
    lab.run(words, out)
    lab.check(words, out)


def no_file(lab, words):
    """A frame that is a folder or a named pipe, which nobody writes to: it fails, the others are made."""
    for make in (Path.mkdir, os.mkfifo):
        out = lab.fresh("no-file", copied=True)
        victim = inputs_of(out)[1]
        victim.unlink()
        make(victim)
        process = lab.start(words, out)
        try:
            _, errors = process.communicate(timeout=60 + 10 * lab.seconds[words[0]])
        except subprocess.TimeoutExpired:
            process.kill()
            raise Failure(f"{make.__name__}: waits for ever") from None
        expect(process.returncode == 1, f"expected exit 1, found {process.returncode}: {errors[-500:]}")
        one_line(errors, victim.name)
        names = sorted(lab.calm[words[0]])
        lab.check(words, out, only=[name for i, name in enumerate(names) if i != 1])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=lambda path: str(Path(path).resolve()))
    parser.add_argument("frames", type=Path)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    passed = failed = 0
    with tempfile.TemporaryDirectory(prefix="fathom-faults-") as folder:
        lab = Lab(options.program, options.frames.resolve(), Path(folder).resolve())
        for words in (DENOISE, COMP):
            chance = random.Random(options.seed)
            checks = {
                f"killed {options.kills} times": lambda: killed(lab, words, options.kills, chance),
                "three at once": lambda: shared(lab, words, 3),
                "one of two killed": lambda: shared_and_killed(lab, words, chance),
                "interrupted": lambda: interrupted(lab, words),
                "full disk": lambda: full_disk(lab, words),
                "no folder": lambda: no_folder(lab, words),
                "truncated input": lambda: truncated(lab, words),
                "vanishing input": lambda: vanishing(lab, words, chance),
                "changed input": lambda: changed(lab, words),
                "starved": lambda: starved(lab, words),
                "read-only folder": lambda: read_only_folder(lab, words),
                "small disk": lambda: small_device(lab, words),
                "linked output": lambda: linked(lab, words),
                "folder removed": lambda: folder_removed(lab, words, chance),
                "input that is no file": lambda: no_file(lab, words),
            }
            for name, check in checks.items():
                try:
                    check()
                    passed += 1
                    print(f"ok      {words[0]}: {name}", flush=True)
                except Skip as why:
                    print(f"skipped {words[0]}: {name}: {why}", flush=True)
                except (Failure, OSError, subprocess.SubprocessError) as error:
                    failed += 1
                    print(f"FAILED  {words[0]}: {name}: {error}", flush=True)
    print(f"{passed} passed, {failed} failed")
    return 1 if failed or not passed else 0


if __name__ == "__main__":
    sys.exit(main())
