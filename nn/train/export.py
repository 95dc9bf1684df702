#!/usr/bin/env python3
"""Makes a weight file and its card of a training.

    export.py OUT WEIGHTS.safetensors [--data "words on the frames"] [--limits "..."] [--frames FOLDER...]

OUT is the folder that train.py wrote. The card, WEIGHTS.md, tells what the weights were trained on, for how long, and
what they reach on the held-out frames by the last rows of the log. From the frames in --frames, of which as many as
--every says are taken, it is found how many components a tile is worth (components.py); without them it is always one.
"""

import argparse
import csv
import time
from pathlib import Path

import torch

import components
from model import COMPONENTS
from weights import load_model, save_model

LICENCE = "Apache-2.0"
LIMITS = (
    "Trained on path-traced frames of interiors, objects and hair, of 2 to 128 samples per pixel; frames of another kind, or"
    " far noisier, are outside of what it has seen. It looks at one frame at a time."
)


def last_rows(path, step):
    """{frame: {components: row}} of the last validation up to a step."""
    with open(path, newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["frame"] and int(row["step"]) <= step]
    result = {}
    for row in rows:
        if row["step"] == rows[-1]["step"]:
            result.setdefault(row["frame"], {})[int(row["components"])] = row
    return result


def card(name, model, saved, rows, words, limits):
    lines = [
        f"# {name}",
        "",
        f"Weights of the compositional denoiser (`nn/train/model.py`), width {model.width},"
        f" {sum(x.numel() for x in model.parameters())} parameters. Licence: {LICENCE}, as Fathom's.",
        "",
        f"- Trained in {saved['step']} steps ({saved['hours']:.1f} hours on {saved['threads']} processor core(s)), batches of"
        f" {saved['batch']}, {saved['batch'] // 2} and {saved['batch'] // 4} crops of {saved['crop']}x{saved['crop']}"
        " pixels for K = 1, 2 and 4; the weights are the running average.",
        f"- Data: {words or 'renders with references'}: {len(saved['frames'])} noisy frames of"
        f" {len(saved['scenes'])} scenes: {', '.join(saved['scenes'])}.",
        f"- Limits: {limits}",
        "",
        "Errors on frames that no training sees, diffuse and specular light denoised apart"
        " (relMSE less the reference's own error, as `fathom compare --correct`):",
        "",
        "| frame | " + " | ".join(f"K = {k}" for k in COMPONENTS) + " |",
        "|---|" + "---|" * len(COMPONENTS),
    ]
    for frame, figures in rows.items():
        lines.append(f"| {frame} | " + " | ".join(f"{float(figures[k]['relmse']):.5f}" for k in COMPONENTS) + " |")
    return "\n".join(lines) + "\n"


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("training", type=Path)
    parser.add_argument("weights", type=Path)
    parser.add_argument("--data", help="words on where the frames come from")
    parser.add_argument("--limits", default=LIMITS)
    parser.add_argument("--frames", nargs="+", default=[], help="folders of frames with references")
    parser.add_argument("--every", type=int, default=2, help="of the frames, each N-th")
    options = parser.parse_args(arguments)
    checkpoint = options.training / "checkpoint.pt"
    saved = torch.load(checkpoint, map_location="cpu")
    model = load_model(checkpoint)
    name = options.weights.stem
    metadata = {"name": name, "licence": LICENCE, "steps": str(saved["step"]), "trained": time.strftime("%Y-%m-%d")}
    save_model(options.weights, model, metadata)
    if options.frames:
        components.main([str(options.weights), *options.frames, "--every", str(options.every)])
    rows = last_rows(options.training / "log.csv", saved["step"])
    text = card(name, model, saved, rows, options.data, options.limits)
    options.weights.with_suffix(".md").write_text(text)


if __name__ == "__main__":
    main()
