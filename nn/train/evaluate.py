#!/usr/bin/env python3
"""Denoises whole frames and compares them with their references, as `fathom compare --correct` does.

    evaluate.py WEIGHTS FOLDER... [--frames fur coffee] [--baselines FILE] [--out FOLDER]

Prints a table: relMSE = mean of (a-r)^2 / (r^2 + 0.01) less the reference's own error, for K = 1, 2 and 4, with the
diffuse and the specular light denoised in passes of their own, and with the whole light denoised at once (K = 4). The
frames are the held-out ones unless they are named. WEIGHTS is a weight file or a checkpoint. With --out, a picture of
each: noisy, denoised, reference.
"""

import argparse
from collections import namedtuple
from pathlib import Path

import numpy as np
import torch

import frames
import png
from model import COMPONENTS, denoised
from planes import LIGHTS, component, exposure, finite, measure, planes, triple
from weights import load_model

DARK = 0.01

# stack, given: as planes.measure returns them; reference, own: its light and the variance of that, (3, height, width).
Subject = namedtuple("Subject", "name noisy stack given exposure reference own")


def subject(pair):
    noisy, reference, _ = frames.load(pair)
    whole = component(noisy, "rgb")
    own = triple(reference, "variance")
    own = np.zeros_like(whole) if own is None else np.maximum(own, 0)
    stack, given = measure(noisy)
    return Subject(pair.name, whole, stack, given, exposure(whole), component(reference, "rgb"), own)


def denoise(model, frame, components, split=True):
    """The denoised light, (3, height, width): of diffuse and specular light in a pass each if `split` and there are."""
    names = LIGHTS[1:] if split and frame.given.issuperset(LIGHTS[1:]) else LIGHTS[:1]
    total = 0
    for name in names:
        inputs, colour, divisor = planes(frame.stack, frame.given, name, frame.exposure)
        with torch.no_grad():
            result = denoised(model, torch.from_numpy(inputs)[None], torch.from_numpy(colour)[None], components)
        total = total + divisor * result[0].numpy() / frame.exposure
    return total


def relmse(image, frame):
    r = frame.reference.astype(np.float64)
    return float((((image - r) ** 2 - frame.own) / (r**2 + DARK)).mean())


def smape(image, frame):
    r = frame.reference
    return float((np.abs(image - r) / (np.abs(image) + np.abs(r) + DARK)).mean())


def read_baselines(path):
    """{frame: relMSE of prefiltered Open Image Denoise}, from the first table with such a column."""
    result, column = {}, None
    for line in Path(path).read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|\n ").split("|")]
        if column is None:
            column = cells.index("oidn prefiltered") if "oidn prefiltered" in cells else None
        elif not line.startswith("|"):
            break
        elif not cells[0].startswith("-"):
            result[cells[0]] = float(cells[column])
    return result


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights", type=Path)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--frames", nargs="+", help="names of frames or of scenes; the held-out scenes")
    parser.add_argument("--baselines", type=Path)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args(arguments)
    model = load_model(options.weights)
    baselines = read_baselines(options.baselines) if options.baselines else {}
    chosen = options.frames or frames.HELD_OUT
    print("| frame | noisy | K = 1 | K = 2 | K = 4 | whole, K = 4 | Open Image Denoise, prefiltered |")
    print("|---|---|---|---|---|---|---|")
    for pair in frames.find(options.folders):
        if not {pair.name, pair.scene} & set(chosen):
            continue
        frame = subject(pair)
        split = [denoise(model, frame, k) for k in COMPONENTS]
        results = [frame.noisy, *split, denoise(model, frame, COMPONENTS[-1], split=False)]
        figures = " | ".join(f"{relmse(x, frame):.5f}" for x in results)
        print(f"| {pair.name} | {figures} | {baselines.get(pair.name, '')} |", flush=True)
        if options.out:
            options.out.mkdir(parents=True, exist_ok=True)
            shown = [png.tone_mapped(2 * frame.exposure * x) for x in (frame.noisy, split[-1], frame.reference)]
            png.write(options.out / (pair.name.replace("/", "-") + ".png"), np.concatenate(shown, 1))


if __name__ == "__main__":
    main()
