#!/usr/bin/env python3
"""Makes what the mix is trained on: for each noisy frame, what denoisers make of it, with its estimated errors.

    mix_candidates.py FOLDER... --out FOLDER [--base nlm,neural,oidn] [--fathom build/bin/fathom]

Runs `fathom progressive --candidates` on every pair that frames.py finds, and leaves OUT/NAME.candidates.exr. The same command
goes on with what a stopped one left to do. Frames that fail are told and passed over.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import frames

SUFFIX = ".candidates.exr"


def candidates_of(folder, pair):
    return Path(folder) / (pair.name + SUFFIX)


def make(options, pair, scratch):
    """True where the file is there now."""
    out = candidates_of(options.out, pair)
    if out.exists():
        return True
    out.parent.mkdir(parents=True, exist_ok=True)
    command = [options.fathom, "progressive", pair.noisy, "-o", Path(scratch) / "mix.exr", "--overwrite"]
    command += ["--base", options.base, "--candidates", out, "--threads", str(options.threads)]
    return subprocess.run([str(x) for x in command], stdout=subprocess.DEVNULL).returncode == 0


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--base", default="nlm,neural,oidn")
    parser.add_argument("--fathom", default="build/bin/fathom")
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args(arguments)
    pairs = frames.find(options.folders)
    with tempfile.TemporaryDirectory() as scratch:
        failed = [pair.name for pair in pairs if not make(options, pair, scratch)]
    if failed:
        sys.exit(f"mix_candidates.py: failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
