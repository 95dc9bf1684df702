#!/usr/bin/env python3
"""Makes a weight file of the mixing network, its card and its log, of a training.

    mix_export.py OUT WEIGHTS.safetensors [--golden FILE] [--data "words on the frames"]

OUT is the folder that mix_train.py wrote. --golden also writes what the network makes of a random input, for other implementations
to be compared with: `shared` (planes, height, width), `own` (candidates, planes, height, width), `weight` and `share`.
"""

import argparse
import csv
import shutil
import time
from pathlib import Path

import numpy as np
import torch

from export import LICENCE
from mix_model import Mix
from mix_planes import OWN, SHARED
from weights import read_tensors, write_tensors

FORMAT, VERSION = "fathom-mix", "1"
LIMITS = (
    "It saw what NL-Means, the network `small` and Open Image Denoise make of path-traced frames of 2 to 64 samples per"
    " pixel; it takes any denoisers, but knows the errors of these. `small` itself was trained on most of those frames."
)


def save(path, model, metadata):
    state = {name: tensor.detach().float().numpy() for name, tensor in model.state_dict().items()}
    write_tensors(path, state, {"format": FORMAT, "version": VERSION, **metadata})


def load(path):
    tensors, metadata = read_tensors(path)
    if metadata.get("format") != FORMAT or metadata.get("version") != VERSION:
        raise ValueError(f"{path}: expected {FORMAT} version {VERSION}, found {metadata}")
    model = Mix()
    model.load_state_dict({name: torch.from_numpy(x) for name, x in tensors.items()})
    return model.eval()


def golden(model, width=44, height=28, candidates=3, seed=7):
    random = np.random.default_rng(seed)
    shared = random.uniform(-1, 1, (SHARED, height, width)).astype(np.float32)
    own = random.uniform(-1, 1, (candidates, OWN, height, width)).astype(np.float32)
    with torch.no_grad():
        weight, share = model(torch.from_numpy(own)[None], torch.from_numpy(shared)[None])
    return {"shared": shared, "own": own, "weight": weight[0, :, 0].numpy(), "share": share[0, 0].numpy()}


def card(name, model, saved, rows, words):
    lines = [
        f"# {name}",
        "",
        f"Weights of the mixing network (`nn/train/mix_model.py`), {sum(x.numel() for x in model.parameters())} parameters."
        f" Licence: {LICENCE}, as Fathom's.",
        "",
        f"- Trained in {saved['step']} steps ({saved['hours']:.1f} hours on {saved['threads']} processor core(s)), batches of"
        f" {saved['batch']} crops of {saved['crop']}x{saved['crop']} pixels; the weights are the running average.",
        f"- Data: {words or 'renders with references'}: {saved['frames']} noisy frames of"
        f" {len(saved['scenes'])} scenes: {', '.join(saved['scenes'])}.",
        f"- Limits: {LIMITS}",
        "",
        "relMSE of frames that its training has not seen, less the reference's own error: of the best of the denoisers, of the"
        " mix without the network, and with it (training's own figures, where the gate is an approximation).",
        "",
        "| frame | denoisers | best | rule | mix |",
        "|---|---|---|---|---|",
    ]
    for row in rows:
        figures = " | ".join(f"{float(row[x]):.5f}" for x in ("best", "rule", "mix"))
        lines.append(f"| {row['frame']} | {row['bases'].replace('+', ', ')} | {figures} |")
    return "\n".join(lines) + "\n"


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("training", type=Path)
    parser.add_argument("weights", type=Path)
    parser.add_argument("--golden", type=Path)
    parser.add_argument("--data", help="words on where the frames come from")
    options = parser.parse_args(arguments)
    saved = torch.load(options.training / "checkpoint.pt", map_location="cpu")
    model = Mix(saved["width"])
    model.load_state_dict(saved["average"])
    name = options.weights.stem
    metadata = {"name": name, "licence": LICENCE, "steps": str(saved["step"]), "trained": time.strftime("%Y-%m-%d")}
    save(options.weights, model, metadata)
    if options.golden:
        write_tensors(options.golden, golden(model))
    log = options.training / "log.csv"
    with open(log, newline="") as file:
        rows = [row for row in csv.DictReader(file) if int(row["step"]) == saved["step"]]
    options.weights.with_suffix(".md").write_text(card(name, model, saved, rows, options.data))
    shutil.copy(log, options.weights.with_suffix(".log.csv"))


if __name__ == "__main__":
    main()
