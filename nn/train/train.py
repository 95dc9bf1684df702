#!/usr/bin/env python3
"""Trains the compositional denoiser.

    train.py --data FOLDER... --out FOLDER [--width 16] [--steps 60000] ...

The same command starts a training and goes on with it: OUT/checkpoint.pt has all of its state, so that a training that
was stopped ends with the bits of one that was not, over the same frames. Frames that appear while it runs are taken in
at the next validation. With --start it begins with the weights of a network of the same width or of half of it. OUT/log.csv has a row per validation and frame, and OUT/cache the prepared frames.

Each step draws K from {1, 2, 4}; a batch of K = 1 has twice the crops of K = 2 and four times those of K = 4, so that
steps cost about the same (supplement, section 2.3).
"""

import argparse
import copy
import csv
import signal
import time
from pathlib import Path

import numpy as np
import torch

import evaluate
import frames
from augment import Batches
from crops import Cache, replace
from loss import loss, schedule
from model import COMPONENTS, Compositional, gigaflops_per_megapixel
from weights import load_model
from widen import widened

SHARES = {1: 0.3, 2: 0.3, 4: 0.4}  # of the steps
AVERAGE = 0.999  # of the weights: how much of the average a step keeps
LARGEST_GRADIENT = 1.0
FIXED = ("width", "batch", "crop", "seed")  # cannot change when a training goes on
COLUMNS = ("step", "hours", "frames", "loss", "frame", "components", "smape", "relmse")


def options(arguments=None, words=__doc__):
    parser = argparse.ArgumentParser(description=words, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", nargs="+", type=Path, required=True, help="folders with frames and references")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--width", type=int, default=16)
    parser.add_argument("--start", type=Path, help="weights or a checkpoint to begin with, of this width or of half of it")
    parser.add_argument("--steps", type=int, default=60000)
    parser.add_argument("--until", type=int, help="step to stop at for now; the rate follows --steps")
    parser.add_argument("--batch", type=int, default=8, help="crops of a step with K = 1, a multiple of 4")
    parser.add_argument("--crop", type=int, default=128, help="side, a multiple of 4")
    parser.add_argument("--rate", type=float, default=1e-3, help="of Adam, after the start")
    parser.add_argument("--warmup", type=int, default=300, help="steps in which the rate rises")
    parser.add_argument("--settle", type=int, default=600, help="steps that keep the masks uniform, or layers apart")
    parser.add_argument("--validate", type=int, default=1000, help="steps between two validations")
    parser.add_argument("--share", type=float, default=0.0, help="of the other scenes that are kept for validation")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=5, help="between two checkpoints")
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    parser.add_argument("--bfloat16", action="store_true", help="convolutions in bfloat16, on processors that have it")
    settings = parser.parse_args(arguments)
    if settings.batch % 4 or settings.crop % 4:
        raise SystemExit("train.py: --batch and --crop: expected multiples of 4")
    return settings


class Training:
    """What makes and trains the compositional denoiser; another network overrides what is its own."""

    columns = COLUMNS

    def __init__(self, settings):
        self.settings = settings
        settings.out.mkdir(parents=True, exist_ok=True)
        torch.manual_seed(settings.seed)
        self.model = self.first_model().to(memory_format=torch.channels_last)
        self.average = copy.deepcopy(self.model)
        self.optimizer = torch.optim.Adam(self.model.parameters(), settings.rate)
        self.step, self.hours, self.losses = 0, 0.0, []
        self.cache, self.batches = self.frames_and_batches()
        self.cache.refresh()
        if self.checkpoint.exists():
            self.resume()
        if not self.cache.frames:
            raise SystemExit("train.py: no frames to train on: " + ", ".join(map(str, settings.data)))
        self.subjects = self.held_out()

    def frames_and_batches(self):
        settings = self.settings
        cache = Cache(settings.out / "cache", settings.data, settings.crop, settings.share)
        return cache, Batches(cache, settings.crop, settings.seed)

    def held_out(self):
        kept = [pair for pair in frames.find(self.settings.data) if frames.held_out(pair.scene, self.settings.share)]
        return [evaluate.subject(pair) for pair in kept]

    def first_model(self):
        settings = self.settings
        if not settings.start:
            return Compositional(settings.width)
        model = load_model(settings.start).train()
        if 2 * model.width == settings.width:
            model = widened(model, settings.seed)
        if model.width != settings.width:
            raise SystemExit(f"train.py: {settings.start}: expected width {settings.width} or half of it, found {model.width}")
        return model

    @property
    def checkpoint(self):
        return self.settings.out / "checkpoint.pt"

    def resume(self):
        saved = torch.load(self.checkpoint, map_location="cpu")
        for name in FIXED:
            if saved[name] != getattr(self.settings, name):
                raise SystemExit(f"train.py: {self.checkpoint}: --{name} was {saved[name]}")
        self.model.load_state_dict(saved["model"])
        self.average.load_state_dict(saved["average"])
        self.optimizer.load_state_dict(saved["optimizer"])
        self.step, self.hours, self.losses = saved["step"], saved["hours"], saved["losses"]
        self.cache.restrict(saved["frames"])
        self.forget_later_rows()

    def save(self):
        state = {name: getattr(self.settings, name) for name in FIXED}
        state.update(step=self.step, hours=self.hours, losses=self.losses, frames=[x.key for x in self.cache.frames])
        state.update(scenes=sorted(self.cache.scenes()), threads=self.settings.threads)
        for name in ("model", "average", "optimizer"):
            state[name] = getattr(self, name).state_dict()
        replace(self.checkpoint, lambda file: torch.save(state, file))

    def drawn(self, shares):
        """One of {choice: its share}, of this step."""
        random = np.random.default_rng([self.settings.seed, self.step, 1])
        return int(random.choice(list(shares), p=list(shares.values())))

    def autocast(self):
        return torch.autocast("cpu", torch.bfloat16, enabled=self.settings.bfloat16)

    def losses_of_step(self):
        """The error, what is to be minimised, and the gigaflops that it takes."""
        settings, k = self.settings, self.drawn(SHARES)
        count = settings.batch // k
        inputs, colours, divisors, references = map(torch.from_numpy, self.batches.batch(self.step, count))
        inputs = inputs.contiguous(memory_format=torch.channels_last)
        with self.autocast():
            result = self.model.result(inputs, colours, k)
        work = 3e-6 * gigaflops_per_megapixel(settings.width, k) * count * settings.crop**2
        return *loss(result, divisors, references, self.step < settings.settle), work

    def train_step(self):
        """One step; the number of gigaflops that it took."""
        settings = self.settings
        for group in self.optimizer.param_groups:
            group["lr"] = settings.rate * schedule(self.step, settings.steps, settings.warmup)
        error, total, work = self.losses_of_step()
        self.optimizer.zero_grad(set_to_none=True)  # what a step does not use, it does not move, whether there was a step before or not
        total.backward()
        torch.nn.utils.clip_grad_norm_(self.model.parameters(), LARGEST_GRADIENT)
        self.optimizer.step()
        self.move_average()
        self.losses.append(float(error))
        self.step += 1
        return work

    def move_average(self):
        keep = min(AVERAGE, (1 + self.step) / (10 + self.step))
        with torch.no_grad():
            for kept, new in zip(self.average.parameters(), self.model.parameters()):
                kept.lerp_(new, 1 - keep)

    def validate(self):
        self.cache.refresh()
        row = {"step": self.step, "hours": f"{self.hours:.4f}", "frames": len(self.cache.frames)}
        row["loss"] = f"{np.mean(self.losses):.5f}"
        self.losses.clear()
        rows = [{**row, "frame": frame.name, **figures} for frame in self.subjects for figures in self.figures(frame)]
        self.write_rows(rows or [row])
        print(f"step {self.step}, {self.hours:.2f} hours, {row['frames']} frames, loss {row['loss']}")
        places = [name for name in self.columns[self.columns.index("frame") + 1 :] if name not in ("smape", "relmse")]
        for place in dict.fromkeys(tuple(x[name] for name in places) for x in rows):
            errors = [x["relmse"] for x in rows if tuple(x[name] for name in places) == place]
            print("  " + ", ".join(f"{name} {x}" for name, x in zip(places, place)) + ": relMSE " + " ".join(errors), flush=True)

    def figures(self, frame):
        """Rows of the log of a held-out frame."""
        for k in COMPONENTS:
            yield {"components": k, **measured(evaluate.denoise(self.average, frame, k), frame)}

    def write_rows(self, rows):
        path = self.settings.out / "log.csv"
        fresh = not path.exists()
        with open(path, "a", newline="") as file:
            writer = csv.DictWriter(file, self.columns, lineterminator="\n")
            if fresh:
                writer.writeheader()
            writer.writerows(rows)

    def forget_later_rows(self):
        path = self.settings.out / "log.csv"
        if path.exists():
            head, *rows = path.read_text().splitlines(keepends=True)
            path.write_text(head + "".join(row for row in rows if int(row.split(",")[0]) <= self.step))

    def run(self):
        """Until the last step, or until it is asked to stop."""
        stopped = []
        for kind in (signal.SIGTERM, signal.SIGINT):
            signal.signal(kind, lambda *_: stopped.append(True))
        begin, hours, saved = time.monotonic(), self.hours, time.monotonic()
        steps, work, worked = 0, 0.0, 0.0
        last = min(self.settings.steps, self.settings.until or self.settings.steps)
        while self.step < last and not stopped:
            started = time.monotonic()
            work += self.train_step()
            now = time.monotonic()
            worked += now - started
            steps += 1
            self.hours = hours + (now - begin) / 3600
            if self.step % self.settings.validate == 0 or self.step == self.settings.steps:
                print(f"{steps / worked:.2f} steps/s, {work / worked:.1f} GFLOP/s", flush=True)
                steps, work, worked = 0, 0.0, 0.0
                self.validate()
            if time.monotonic() - saved > 60 * self.settings.minutes:
                self.save()
                saved = time.monotonic()
        self.save()


def measured(image, frame):
    return {"smape": f"{evaluate.smape(image, frame):.6f}", "relmse": f"{evaluate.relmse(image, frame):.6f}"}


def main(arguments=None):
    settings = options(arguments)
    torch.set_num_threads(settings.threads)
    Training(settings).run()


if __name__ == "__main__":
    main()
