#!/usr/bin/env python3
"""Trains the layered denoiser.

    train_layers.py --data FOLDER... --out FOLDER [--width 32] [--steps 20000] ...

As train.py, on files of samples, X.samples.exr or X.<spp>.samples.exr, and their references. The scenes fur, coffee and living-room, and the
shared frame staircase2, are never trained on; --share holds back some of the others. With --start, weights or a checkpoint of the same width,
it begins with those of a layered denoiser, or with the U-net of a compositional one's filter.

Each step draws L from {1, 2, 4}. Batches are of the same size for all, since the layers are a small part of the work.
"""

from concurrent.futures import ThreadPoolExecutor

import torch

import evaluate_layers
import frames
import layers_crops
import train
from layers_augment import Batches
from layers_loss import loss
from layers_model import LAYERS, Layered, gigaflops_per_megapixel
from weights import kind_of, load_model

SHARES = {1: 0.25, 2: 0.45, 4: 0.3}  # of the steps
LOGGED = (*(("samples", k) for k in LAYERS), ("pixels", 1))  # form and layers


class Training(train.Training):
    columns = ("step", "hours", "frames", "loss", "frame", "form", "layers", "smape", "relmse")

    def first_model(self):
        settings = self.settings
        if settings.start and kind_of(settings.start) is Layered:
            model = load_model(settings.start, Layered).train()
            self.expect_width(model.width)
            return model
        model = Layered(settings.width)
        if settings.start:
            begun = load_model(settings.start).denoise
            self.expect_width(begun.kernel0.in_channels)
            known, taken = model.unet.state_dict(), begun.state_dict()
            model.unet.load_state_dict({name: x if name.startswith("in.") else taken[name] for name, x in known.items()})
        return model

    def expect_width(self, found):
        if found != self.settings.width:
            raise SystemExit(f"train_layers.py: {self.settings.start}: expected width {self.settings.width}, found {found}")

    def frames_and_batches(self):
        settings = self.settings
        cache = layers_crops.Cache(settings.out / "cache", settings.data, settings.crop, settings.share)
        self.beside, self.ahead = ThreadPoolExecutor(1), None
        return cache, Batches(cache, settings.crop, settings.seed)

    def batch(self):
        """That of this step. The next one is begun beside the work on it, unless frames may come before."""
        count = self.settings.batch
        made = self.ahead.result() if self.ahead else self.batches.batch(self.step, count)
        coming = (self.step + 1) % self.settings.validate == 0
        self.ahead = None if coming else self.beside.submit(self.batches.batch, self.step + 1, count)
        return made

    def held_out(self):
        pairs = frames.find(self.settings.data, frames.SAMPLES)
        forms = {form for form, _ in LOGGED}
        return [evaluate_layers.subject(x, sorted(forms)) for x in pairs if layers_crops.held_out(x, self.settings.share)]

    def losses_of_step(self):
        settings, layers = self.settings, self.drawn(SHARES)
        samples, targets = self.batch()
        with self.autocast():
            result = self.model.result(samples, layers)
        pixels = settings.batch * settings.crop**2
        work = 3e-6 * gigaflops_per_megapixel(settings.width, layers, len(samples.pixel) / pixels) * pixels
        return *loss(result, samples, torch.from_numpy(targets), min(1.0, self.step / max(1, settings.settle))), work

    def figures(self, frame):
        for form, layers in LOGGED:
            image, _ = evaluate_layers.result_of(self.average, frame, form, layers)
            seen, part = evaluate_layers.only(image, frame, frame.counted)
            yield {"form": form, "layers": layers, **train.measured(seen, part)}


def main(arguments=None):
    settings = train.options(arguments, __doc__)
    torch.set_num_threads(settings.threads)
    Training(settings).run()


if __name__ == "__main__":
    main()
