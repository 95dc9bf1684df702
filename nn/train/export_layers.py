#!/usr/bin/env python3
"""Makes a weight file and its card of a training of the layered network.

    export_layers.py OUT WEIGHTS.safetensors [--data "words on the frames"]

As export.py: OUT is the folder that train_layers.py wrote. Beside the weights lie their card, WEIGHTS.md, and what it takes to go on: WEIGHTS.log.csv
and WEIGHTS.training.pt, the log and the checkpoint of OUT.
"""

import argparse
import csv
import shutil
import time
from pathlib import Path

import torch

from export import LICENCE
from layers_model import Layered
from weights import load_model, save_model

LIMITS = (
    "Trained on path-traced frames of 2 to 16 samples per pixel, and of 2 to 64 clustered into bins, of interiors, objects, hair and leaves, with and"
    " without a lens; frames of another kind, or with far more samples, are outside of what it has seen. It knows no volumes, motion or time."
)


def last_rows(path, step):
    """The rows of the last validation up to a step."""
    with open(path, newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["frame"] and int(row["step"]) <= step]
    return [row for row in rows if row["step"] == rows[-1]["step"]] if rows else []


def table(rows):
    places = list(dict.fromkeys((row["form"], row["layers"]) for row in rows))
    errors = {(row["frame"], row["form"], row["layers"]): float(row["relmse"]) for row in rows}
    lines = ["| frame | " + " | ".join(f"{form}, L = {layers}" for form, layers in places) + " |", "|---|" + "---|" * len(places)]
    for frame in dict.fromkeys(row["frame"] for row in rows):
        lines.append(f"| {frame} | " + " | ".join(f"{errors[(frame, *place)]:.5f}" for place in places) + " |")
    return lines


def card(name, model, saved, rows, words):
    return "\n".join([
        f"# {name}",
        "",
        f"Weights of the layered denoiser (`nn/train/layers_model.py`), width {model.width}, {sum(x.numel() for x in model.parameters())} parameters."
        f" Licence: {LICENCE}, as Fathom's.",
        "",
        f"- Trained in {saved['step']} steps ({saved['hours']:.1f} hours on {saved['threads']} processor core(s), batches made on one more) of {saved['batch']} crops of"
        f" {saved['crop']}x{saved['crop']} pixels, with 1, 2 or 4 layers in turn; the weights are the running average.",
        f"- Data: {words or 'renders with references'}: {len(saved['frames'])} frames of {len(saved['scenes'])} scenes: {', '.join(saved['scenes'])}.",
        f"- Limits: {LIMITS}",
        "",
        "Errors on frames that no training sees, of 8 samples per pixel (relMSE less the reference's own error): of the samples with 1, 2 and 4 layers,"
        " and of one bin per pixel, which is what a network on pixels sees:",
        "",
        *table(rows),
    ]) + "\n"  # fmt: skip


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("training", type=Path)
    parser.add_argument("weights", type=Path)
    parser.add_argument("--data", help="words on where the frames come from")
    options = parser.parse_args(arguments)
    checkpoint, name = options.training / "checkpoint.pt", options.weights.stem
    saved, model = torch.load(checkpoint, map_location="cpu"), load_model(checkpoint, Layered)
    metadata = {"name": name, "licence": LICENCE, "steps": str(saved["step"]), "trained": time.strftime("%Y-%m-%d")}
    save_model(options.weights, model, metadata)
    rows = last_rows(options.training / "log.csv", saved["step"])
    options.weights.with_suffix(".md").write_text(card(name, model, saved, rows, options.data))
    for name in ("log.csv", "checkpoint.pt"):
        shutil.copy(options.training / name, options.weights.with_suffix("." + name.replace("checkpoint", "training")))


if __name__ == "__main__":
    main()
