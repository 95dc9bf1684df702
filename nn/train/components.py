#!/usr/bin/env python3
"""Fits what more components are worth to a block of pixels, and writes it into a weight file.

    components.py WEIGHTS.safetensors FOLDER... [--table FILE.npz] [--every N] [--dry]

All frames with references are denoised with K = 1, 2 and 4; frames of the held-out scenes judge the fit only. A row of the
table is a block of 64x64 pixels and a light of it: its statistics (blocks.py), the error of the whole colour with K = 1, and
by how much that falls where this light has K = 2 or 4. The reference's own noise cancels in that difference, and is taken
off the error. A ridge regression, weighted by the error of a block in its frame's, predicts the part that falls; the
coefficients go into the metadata as components.gain2 and components.gain4, with nn/components.cpp at the other end. So what
is chosen goes by the sum of errors, and a block that is done well with K = 1 has little say.

Printed is what there is to win: the error left by K = 2 and 4 everywhere, by the best K of each block as the references
know it (which fits their noise, too), and by the rule, over that of K = 1; and what it costs.
"""

import argparse
from pathlib import Path

import numpy as np
import torch

import frames
from blocks import NAMES, statistics
from evaluate import DARK, subject
from model import COMPONENTS, denoised, gigaflops_per_megapixel
from planes import LIGHTS, planes
from weights import load_model, read_tensors, write_tensors

SIDE = 64
LEAST_ERROR = 0.02  # of a block, by the mean of its frame's: keeps ratios finite
RIDGE = 1e-3
THRESHOLD = 0.02  # the part of the error that one more pass of K = 1 must take off

FIELDS = ("scene", "frame", "pixels", "error", "fall2", "fall4")


def lights_of(frame):
    return LIGHTS[1:] if frame.given.issuperset(LIGHTS[1:]) else LIGHTS[:1]


def rows_of(model, pair):
    """Rows of a frame: its FIELDS but the names, and the statistics."""
    frame = subject(pair)
    made, inputs = {}, {}
    for name in lights_of(frame):
        inputs[name], colour, divisor = planes(frame.stack, frame.given, name, frame.exposure)
        with torch.no_grad():
            for k in COMPONENTS:
                result = denoised(model, torch.from_numpy(inputs[name])[None], torch.from_numpy(colour)[None], k)
                made[name, k] = (divisor * result[0].numpy()).astype(np.float64) / frame.exposure
    base = sum(made[name, 1] for name in inputs)
    reference = frame.reference.astype(np.float64)
    scale = 1 / (reference**2 + DARK)
    height, width = (side // 4 * 4 for side in base.shape[1:])
    result = []
    for y in range(0, height, SIDE):
        for x in range(0, width, SIDE):
            at = np.s_[:, y : min(y + SIDE, height), x : min(x + SIDE, width)]
            error = (((base[at] - reference[at]) ** 2 - frame.own[at]) * scale[at]).sum()
            for name in inputs:
                falls = []
                for k in COMPONENTS[1:]:
                    change = made[name, k][at] - made[name, 1][at]
                    falls.append(-(change * (change + 2 * (base[at] - reference[at])) * scale[at]).sum())
                result.append([base[at][0].size, error, *falls, *statistics(inputs[name][at])])
    return result


class Table:
    """Columns as arrays; errors and falls in parts of their frame's error with K = 1."""

    def __init__(self, scene, frame, numbers):
        self.scene, self.frame, numbers = np.array(scene), np.array(frame), np.array(numbers)
        self.pixels, error, falls = numbers[:, 0], numbers[:, 1], numbers[:, 2:4]
        self.statistics = numbers[:, 4:]
        self.weight, self.falls = np.zeros_like(error), np.zeros_like(falls)
        for name in np.unique(self.frame):
            of = self.frame == name
            lights = 2 if self.statistics[of, NAMES.index("part")].any() else 1
            whole = max(error[of].sum() / lights, 1e-12)
            mean = whole * self.pixels[of] * lights / self.pixels[of].sum()
            self.weight[of] = np.maximum(error[of], LEAST_ERROR * mean) / whole
            self.falls[of] = falls[of] / whole
        self.gains = np.clip(self.falls / self.weight[:, None], -1, 1)

    def fit(self, of):
        """Coefficients (2, statistics) from the rows `of`, each frame with the same weight."""
        x, w = self.statistics[of], self.weight[of]
        scale = np.sqrt((x**2).mean(0)) + 1e-9
        x = x / scale
        normal = (x * w[:, None]).T @ x + (RIDGE * w.sum() + 1e-12) * np.eye(x.shape[1])
        return (np.linalg.solve(normal, (x * w[:, None]).T @ self.gains[of]) / scale[:, None]).T

    def left(self, of, choice):
        """The mean over frames of the error over that of K = 1, where `choice` is 0, 1 or 2 for K = 1, 2, 4."""
        falls = np.concatenate([np.zeros((len(self.falls), 1)), self.falls], 1)
        taken = np.take_along_axis(falls, choice[:, None], 1)[:, 0]
        return np.mean([1 - taken[of & (self.frame == name)].sum() for name in np.unique(self.frame[of])])


def chosen(gains, costs, threshold):
    """0, 1 or 2 for K = 1, 2, 4: what is left of the gain when each further pass of K = 1 has cost the threshold."""
    worth = np.concatenate([np.zeros((len(gains), 1)), gains - threshold * (costs[1:] / costs[0] - 1)], 1)
    return worth.argmax(1)


def tabulate(model, pairs):
    scene, frame, numbers = [], [], []
    for i, pair in enumerate(pairs):
        try:
            rows = rows_of(model, pair)
        except (OSError, ValueError) as problem:
            print(f"left out: {problem}")
            continue
        scene += [pair.scene] * len(rows)
        frame += [pair.name] * len(rows)
        numbers += rows
        print(f"{i + 1} of {len(pairs)} frames\r", end="", flush=True)
    print()
    return scene, frame, numbers


def across_scenes(table, learned):
    """Predictions for every row; of scenes that are learned from, by a fit without a fifth of the scenes, theirs among
    it."""
    coefficients = table.fit(learned)
    result = table.statistics @ coefficients.T
    scenes = np.unique(table.scene[learned])
    for fold in range(5):
        out = np.isin(table.scene, scenes[fold::5])
        result[out] = table.statistics[out] @ table.fit(learned & ~out).T
    return coefficients, result


def report(table, learned, predicted, costs, thresholds):
    rules = "".join(f" rule at {t} | cost |" for t in thresholds)
    print("| frames | K = 2 | K = 4 | best of each block | best at 0.02 a pass |" + rules)
    print("|---|---|---|---|---|" + "---|---|" * len(thresholds))
    rows = [("learned from", learned), ("held out", ~learned)]
    rows += [(name, ~learned & (table.frame == name)) for name in np.unique(table.frame[~learned])]
    for name, of in rows:
        if not of.any():
            continue
        same = [table.left(of, np.full(len(predicted), k)) for k in (1, 2)]
        oracle = chosen(table.falls / table.weight[:, None], costs, 0)
        frugal = chosen(table.falls / table.weight[:, None], costs, 0.02)
        cells = [*same, table.left(of, oracle), table.left(of, frugal)]
        for threshold in thresholds:
            choice = chosen(predicted, costs, threshold)
            cells += [table.left(of, choice), np.average(costs[choice[of]] / costs[0], weights=table.pixels[of])]
        print(f"| {name} | " + " | ".join(f"{x:.3f}" for x in cells) + " |")


def store(path, coefficients):
    tensors, metadata = read_tensors(path)
    for k, row in zip(COMPONENTS[1:], coefficients):
        metadata[f"components.gain{k}"] = " ".join(f"{x:.6g}" for x in row)
    write_tensors(path, tensors, metadata)


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights", type=Path)
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--table", type=Path, help="where the rows are kept; read where it is there")
    parser.add_argument("--every", type=int, default=1, help="of the frames to learn from, each N-th")
    parser.add_argument("--dry", action="store_true", help="print, and leave the weights as they are")
    options = parser.parse_args(arguments)
    model = load_model(options.weights)
    if options.table and options.table.exists():
        saved = np.load(options.table)
        table = Table(saved["scene"], saved["frame"], saved["numbers"])
    else:
        pairs = frames.find(options.folders)
        learn = [pair for pair in pairs if not frames.held_out(pair.scene)]
        scene, frame, numbers = tabulate(model, learn[:: options.every] + [p for p in pairs if frames.held_out(p.scene)])
        if options.table:
            np.savez_compressed(options.table, scene=scene, frame=frame, numbers=numbers)
        table = Table(scene, frame, numbers)
    costs = np.array([gigaflops_per_megapixel(model.width, k) for k in COMPONENTS])
    learned = np.array([not frames.held_out(scene) for scene in table.scene])
    if not learned.any():
        print("no frames to learn from: one component everywhere")
        return
    coefficients, predicted = across_scenes(table, learned)
    report(table, learned, predicted, costs, (0, 0.005, 0.01, THRESHOLD))
    if not options.dry:
        store(options.weights, coefficients)


if __name__ == "__main__":
    main()
