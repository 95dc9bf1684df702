#!/usr/bin/env python3
"""Trains the mixing network on what mix_candidates.py made.

    mix_train.py --data FOLDER... --candidates FOLDER... --out FOLDER [--steps 6000] ...

The folders with candidates belong to those with frames, in the same order. The same command starts a training and goes on with
it: OUT/checkpoint.pt has all of its state. Each step draws how many of a frame's candidates there are, and which, and
which crops, turned and with colours exchanged. What is minimised is SMAPE and, since the figure that counts is a squared
one, the relMSE over that of the rule without a network. OUT/log.csv has a row per validation, held-out frame and set of
candidates: the relMSE of the best of them, of the rule and of the mix.
"""

import argparse
import copy
import csv
import itertools
import signal
import time
from collections import namedtuple
from pathlib import Path

import numpy as np
import torch

import frames
import mix_planes
from crops import replace
from exr import read
from loss import schedule, smape
from mix_candidates import candidates_of
from mix_model import Mix, mixed
from planes import component, exposure, triple

COUNTS = {1: 0.2, 2: 0.45, 3: 0.35}  # how often so many candidates are mixed
SQUARED = 0.15  # weight of the squared error
AVERAGE = 0.998
# Of the mean squares of what the network adds to logits. Renders to learn from are few, and the rule is good: without it,
# what suits the scenes of the training makes others (hair) worse.
HELD = 0.01
MISSING = {"albedo": (slice(3, 6), 0.3), "normal": (slice(6, 9), 0.3), "depth": (slice(9, 10), 0.3)}  # how often, in `shared`
DARK = 0.01
COLUMNS = ("step", "hours", "frame", "bases", "best", "rule", "mix")
LAYERS = ("x", "noise", "samples", "reference", "own_noise", "shared", "own", "y", "error", "variance", "covariance", "gate")

# bases: names; layers: {name: float32 (channels, ...) or (bases, channels, ...)}; norm: relMSE of the rule with all bases.
Frame = namedtuple("Frame", "pair scale bases layers norm")


def options(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", nargs="+", type=Path, required=True)
    parser.add_argument("--candidates", nargs="+", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--width", type=int, default=16)
    parser.add_argument("--steps", type=int, default=6000)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--crop", type=int, default=96, help="side, a multiple of 4")
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--validate", type=int, default=500)
    parser.add_argument("--share", type=float, default=0.1, help="of the other scenes that are kept for validation")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--bfloat16", action="store_true")
    return parser.parse_args(arguments)


def load(pair, folder):
    noisy, reference, spp = frames.load(pair)
    candidates, _ = read(candidates_of(folder, pair))
    bases = sorted({name.split(".")[0] for name in candidates})
    scale = exposure(component(noisy, "rgb"))
    x, noise, samples = mix_planes.render(noisy, spp, scale)
    own_noise = triple(reference, "variance")
    layers = {
        "x": x, "noise": noise, "samples": samples[None], "shared": mix_planes.shared(noisy, spp, scale),
        "reference": component(reference, "rgb") * np.float32(scale),
        "own_noise": np.zeros_like(x) if own_noise is None else np.maximum(own_noise, 0) * np.float32(scale**2),
        "own": np.stack([mix_planes.own(noisy, spp, candidates, base, scale) for base in bases]),
    }  # fmt: skip
    parts = zip(*(mix_planes.parts(candidates, base, scale) for base in bases))
    layers.update(zip(("y", "error", "variance", "covariance", "gate"), map(np.stack, parts)))
    layers = {name: np.ascontiguousarray(layers[name], np.float32) for name in LAYERS}
    frame = Frame(pair, scale, bases, layers, 0)
    return frame._replace(norm=max(relmse(apply(None, frame, bases), frame), 1e-5))


def tensors(frame, bases, cut=(slice(None), slice(None))):
    """The layers of a part of the frame with these candidates, as the model takes them, without a first dimension."""
    which = [frame.bases.index(base) for base in bases]
    result = {}
    for name, layer in frame.layers.items():
        layer = layer[..., cut[0], cut[1]]
        result[name] = torch.from_numpy(np.ascontiguousarray(layer[which] if layer.ndim == 4 else layer))
    return result


def run(model, part, bfloat16=False):
    """The mix for a batch of `tensors`, and the mean squares of what the network adds to the rule."""
    if model is None:
        logits, share = torch.zeros_like(part["gate"]), torch.zeros_like(part["samples"])
    else:
        with torch.autocast("cpu", torch.bfloat16, enabled=bfloat16):
            logits, share = model(part["own"], part["shared"])
    names = ("x", "noise", "samples", "y", "error", "variance", "covariance", "gate")
    added = ((logits - logits.mean(1, keepdim=True)) ** 2).mean() + (share**2).mean()
    return mixed(logits, share, *(part[name] for name in names))[0], added


def apply(model, frame, bases):
    """The mix of a whole frame, (3, height, width), in exposed units."""
    part = {name: layer[None] for name, layer in tensors(frame, bases).items()}
    height, width = part["x"].shape[2:]
    for name, layer in part.items():  # sides become multiples of 4
        rows, columns = (np.minimum(np.arange(side + -side % 4), side - 1) for side in (height, width))
        part[name] = layer[..., rows, :][..., columns]
    with torch.no_grad():
        result, _ = run(model, part)
    return result[0, :, :height, :width].numpy()


def relmse(image, frame):
    """As `fathom compare --correct`, of the scene's own units."""
    r, square = frame.layers["reference"].astype(np.float64), frame.scale**2
    return float((((image - r) ** 2 - frame.layers["own_noise"]) / (r**2 + DARK * square)).mean())


def turned(random, part):
    """Upside down, left to right, across the diagonal, colours exchanged."""
    flips = [axis for axis in (-2, -1) if random.random() < 0.5]
    transposed, colours = random.random() < 0.5, random.permutation(3).tolist()
    for name, layer in part.items():
        layer = torch.flip(layer, flips)
        layer = layer.transpose(-1, -2) if transposed else layer
        if name in ("own", "shared"):
            triples = (0,) if name == "own" else (0, 3)  # colour; albedo
            order = list(range(layer.shape[-3]))
            for first in triples:
                order[first : first + 3] = [first + c for c in colours]
            layer = layer[..., order, :, :]
        elif layer.shape[-3] == 3:
            layer = layer[..., colours, :, :]
        part[name] = layer
    return part


class Training:
    def __init__(self, settings):
        self.settings = settings
        settings.out.mkdir(parents=True, exist_ok=True)
        torch.manual_seed(settings.seed)
        self.model = Mix(settings.width).to(memory_format=torch.channels_last)
        self.average = copy.deepcopy(self.model)
        self.optimizer = torch.optim.Adam(self.model.parameters(), settings.rate)
        self.step, self.hours = 0, 0.0
        self.scenes, self.kept = {}, []
        for root, folder in zip(settings.data, settings.candidates):
            for pair in frames.find([root]):
                if not candidates_of(folder, pair).exists():
                    continue
                frame = load(pair, folder)
                kept = frames.held_out(pair.scene, settings.share)
                (self.kept if kept else self.scenes.setdefault(pair.scene, [])).append(frame)
        print(f"{sum(map(len, self.scenes.values()))} frames of {len(self.scenes)} scenes, {len(self.kept)} kept", flush=True)
        if self.checkpoint.exists():
            self.resume()

    @property
    def checkpoint(self):
        return self.settings.out / "checkpoint.pt"

    def resume(self):
        saved = torch.load(self.checkpoint, map_location="cpu")
        for name in ("model", "average", "optimizer"):
            getattr(self, name).load_state_dict(saved[name])
        self.step, self.hours = saved["step"], saved["hours"]

    def save(self):
        state = {"step": self.step, "hours": self.hours, "width": self.settings.width, "threads": self.settings.threads}
        state.update(batch=self.settings.batch, crop=self.settings.crop, scenes=sorted(self.scenes))
        state.update(frames=sum(map(len, self.scenes.values())))
        for name in ("model", "average", "optimizer"):
            state[name] = getattr(self, name).state_dict()
        replace(self.checkpoint, lambda file: torch.save(state, file))

    def batch(self, random):
        """`tensors` of some crops with as many candidates each, and the norms of their frames."""
        scenes, size = list(self.scenes.values()), self.settings.crop
        shares = np.sqrt([len(scene) for scene in scenes])
        count = int(random.choice(list(COUNTS), p=list(COUNTS.values())))
        parts, norms = [], []
        for _ in range(self.settings.batch):
            scene = scenes[random.choice(len(scenes), p=shares / shares.sum())]
            frame = scene[random.integers(len(scene))]
            bases = [frame.bases[i] for i in random.permutation(len(frame.bases))[:count]]
            height, width = frame.layers["x"].shape[1:]
            y, x = random.integers(height - size + 1), random.integers(width - size + 1)
            part = turned(random, tensors(frame, bases, (slice(y, y + size), slice(x, x + size))))
            part["shared"] = part["shared"].clone()
            for planes, share in MISSING.values():
                if random.random() < share:
                    part["shared"][planes] = 0
            parts.append(part)
            norms.append(frame.norm)
        return {name: torch.stack([part[name] for part in parts]) for name in LAYERS}, torch.tensor(norms)

    def train_step(self):
        settings = self.settings
        random = np.random.default_rng([settings.seed, self.step])
        part, norms = self.batch(random)
        for group in self.optimizer.param_groups:
            group["lr"] = settings.rate * schedule(self.step, settings.steps, 200)
        result, added = run(self.model, part, settings.bfloat16)
        reference = part["reference"]
        squared = ((result - reference) ** 2 / (reference**2 + DARK)).mean((1, 2, 3)) / norms
        total = smape(result, reference) + SQUARED * (squared + 1).log().mean() + HELD * added
        self.optimizer.zero_grad()
        total.backward()
        torch.nn.utils.clip_grad_norm_(self.model.parameters(), 1.0)
        self.optimizer.step()
        keep = min(AVERAGE, (1 + self.step) / (10 + self.step))
        with torch.no_grad():
            for kept, new in zip(self.average.parameters(), self.model.parameters()):
                kept.lerp_(new, 1 - keep)
        self.step += 1

    def validate(self):
        rows, ratios = [], {}
        for frame in self.kept:
            # Of the denoisers alone; ratios are taken to the best of them.
            singles = {base: relmse(frame.layers["y"][frame.bases.index(base)], frame) for base in frame.bases}
            for count in range(1, len(frame.bases) + 1):
                for bases in itertools.combinations(frame.bases, count):
                    figures = [min(singles[base] for base in bases)]
                    figures += [relmse(apply(model, frame, bases), frame) for model in (None, self.average)]
                    name = "+".join(bases)
                    rows.append([self.step, f"{self.hours:.4f}", frame.pair.name, name, *(f"{x:.6f}" for x in figures)])
                    ours = frame.pair.scene in frames.HELD_OUT
                    ratios.setdefault((ours, name), []).append([x / min(singles.values()) for x in figures])
        path = self.settings.out / "log.csv"
        fresh = not path.exists()
        with open(path, "a", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerows([COLUMNS] * fresh + rows)
        print(f"step {self.step}, {self.hours:.2f} hours; over the best denoiser: best of these, rule, mix")
        for (ours, name), values in sorted(ratios.items()):
            print("  held out" if ours else "  random  ", f"{name:16}", *(f"{x:.3f}" for x in np.mean(values, 0)), flush=True)

    def run(self):
        stopped = []
        for kind in (signal.SIGTERM, signal.SIGINT):
            signal.signal(kind, lambda *_: stopped.append(True))
        begin, hours = time.monotonic(), self.hours
        while self.step < self.settings.steps and not stopped:
            self.train_step()
            self.hours = hours + (time.monotonic() - begin) / 3600
            if self.step % self.settings.validate == 0 or self.step == self.settings.steps:
                self.validate()
                self.save()
        self.save()


def main(arguments=None):
    settings = options(arguments)
    torch.set_num_threads(settings.threads)
    Training(settings).run()


if __name__ == "__main__":
    main()
