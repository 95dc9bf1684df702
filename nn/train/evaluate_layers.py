#!/usr/bin/env python3
"""Denoises whole frames of samples with the layered network, and compares them with their references.

    evaluate_layers.py WEIGHTS FOLDER... [--frames fur staircase2] [--other NAME=FOLDER ...] [--out FOLDER]

Prints two tables of relMSE (as evaluate.py has it): over all pixels, and over those that see two depths or more; and a third of which samples
the front one of two layers takes there. Of each frame the camera samples, bins of them, and one bin per pixel (what a network on pixels sees) are
denoised with 1, 2 and 4 layers. The frames are the held-out ones unless they are named. --other: results of another denoiser, FOLDER/FRAME.exr,
compared in the same pixels. With --out, pictures of each: noisy, denoised, reference; and of two and of four layers, front to back: light over
black, light over grey, opacity, depth.
"""

import argparse
from collections import namedtuple
from pathlib import Path

import numpy as np
import torch

import frames
import layers_crops
import png
import samples
from clusters import gathered, labels
from evaluate import relmse
from exr import read
from layers_model import LAYERS, Layered, assembled, together
from planes import component, triple
from weights import load_model

FORMS = ("samples", "bins", "pixels")
EXPONENT, FIRST = 2.0, 1  # of the clustering

# forms: {form: samples.Deep}; several: where a pixel sees two depths; counted: where the reference sees no
# miss, of which samples know nothing, and figures are taken; reference, own: light and the variance of that, (3, height, width).
Subject = namedtuple("Subject", "name forms exposure depth several counted noisy reference own")
Layer = namedtuple("Layer", "radiance opacity depth")


def in_form(deep, form, spp, scale):
    """The list of a frame of camera samples in one of FORMS."""
    if form == "samples":
        return deep
    stack = layers_crops.stacked(deep, spp).reshape(-1, spp, layers_crops.PHYSICAL)
    z = stack[:, :, samples.WHERE["depth"].start]
    counts = (z > 0).sum(1)
    label = labels(z, counts, scale, EXPONENT, FIRST) if form == "bins" else np.zeros(z.shape, np.int64)
    values, pixel = gathered(stack, counts, label)
    weight = (values[:, samples.WHERE["count"]][:, 0] / spp).astype(np.float32)
    return samples.Deep(values, weight, pixel, deep.shape, deep.given)


def subject(pair, forms=FORMS):
    deep, attributes, reference = layers_crops.load(pair)
    spp, scale = int(attributes["fathom:spp"]), float(attributes["fathom:ppuScale"])
    own, light = triple(reference, "variance"), component(reference, "rgb")
    counts = layers_crops.counted(light, np.asarray(reference.get("A", np.ones(deep.shape)))) > 0
    noisy = samples.flattened(deep, samples.light_of(deep.values))
    light = np.where(counts, light, noisy)  # what samples do not know of is no error of theirs
    own = np.where(counts, np.zeros_like(light) if own is None else np.maximum(own, 0), 0)
    z = layers_crops.stacked(deep, spp)[..., samples.WHERE["depth"].start]
    return Subject(
        pair.name, {form: in_form(deep, form, spp, scale) for form in forms}, samples.exposure_of(deep), samples.mean_depth(deep),
        layers_crops.several(z), counts, noisy, light, own,
    )  # fmt: skip


def network_result(model, frame, form, layers):
    results = []
    for deep in samples.lights_apart(frame.forms[form]):
        parts = samples.listed(deep, frame.exposure, frame.depth)
        with torch.no_grad():
            results.append(model.result(assembled([parts], samples.padded(deep.shape)), layers, results[0].partition if results else None))
    return together(results)


def fronts(model, frame):
    """Of two layers, the front one's mean shares of the nearest and of the farthest sample, where a pixel sees two depths."""
    deep = frame.forms["samples"]
    front = network_result(model, frame, "samples", 2).partition[:, 0].numpy()
    first = np.flatnonzero(np.diff(deep.pixel, prepend=-1))
    last = np.append(first[1:], len(deep.pixel)) - 1
    there = frame.several.ravel()[deep.pixel[first]]
    return front[first][there].mean(), front[last][there].mean()


def result_of(model, frame, form, layers):
    """The denoised light (3, height, width), and the layers, front to back, in the frame's units."""
    height, width = frame.forms[form].shape
    result = network_result(model, frame, form, layers)

    def crop(x, scale=1.0):
        return x[..., :height, :width].numpy() / scale

    light, opacity = crop(result.radiance[:, 0], frame.exposure), crop(result.opacity[:, 0])
    return crop(result.colour[0], frame.exposure), [Layer(*x) for x in zip(light, opacity, crop(result.depth[:, 0]))]


def only(image, frame, where):
    """Some pixels of both, one behind the other."""
    return image[:, where], frame._replace(reference=frame.reference[:, where], own=frame.own[:, where])


def errors(images, frame, where):
    """{column: relMSE over some pixels}."""
    return {name: relmse(*only(x, frame, where)) if where.any() else float("nan") for name, x in images.items()}


def figures(model, frame, others):
    """{column: image}."""
    images = {"noisy": frame.noisy}
    for form in FORMS:
        images.update({f"{form}, L = {k}": result_of(model, frame, form, k)[0] for k in LAYERS})
    for other in others:
        name, _, folder = other.partition("=")
        path = Path(folder) / (frame.name + ".exr")
        images[name] = component(read(path)[0], "rgb") if path.exists() else np.full_like(frame.noisy, np.nan)
    return images


def table(title, rows):
    print(f"\n{title}\n\n| frame | " + " | ".join(rows[0][1]) + " |\n|---|" + "---|" * len(rows[0][1]))
    for name, values in rows:
        print(f"| {name} | " + " | ".join(f"{x:.5f}" for x in values.values()) + " |")


def shown_depth(layer, near, far):
    """Near white, far dark, black where the layer is empty."""
    z = layer.depth / np.maximum(layer.opacity, 1e-6)
    along = np.log(np.clip(z, near, far) / near) / max(np.log(far / near), 1e-6)
    return np.repeat((1 - 0.8 * along) * (layer.opacity > 0.02), 3, 0)


def layer_picture(layers, frame):
    rows = []
    z = frame.forms["samples"].values[:, samples.WHERE["depth"]]
    near, far = np.quantile(z, [0.02, 0.98])
    for layer in layers:
        lit = 2 * frame.exposure * layer.radiance
        views = [png.tone_mapped(x) for x in (lit, lit + 0.3 * (1 - layer.opacity))]
        views += [(255 * np.clip(x, 0, 1) + 0.5).astype(np.uint8).transpose(1, 2, 0) for x in (np.repeat(layer.opacity, 3, 0), shown_depth(layer, near, far))]
        rows.append(np.concatenate(views, 1))
    return np.concatenate(rows, 0)


def write_pictures(folder, frame, model):
    folder.mkdir(parents=True, exist_ok=True)
    name = frame.name.replace("/", "-")
    image, layers = result_of(model, frame, "samples", 2)
    shown = [png.tone_mapped(2 * frame.exposure * x) for x in (frame.noisy, image, frame.reference)]
    png.write(folder / f"{name}.png", np.concatenate(shown, 1))
    for k in LAYERS[1:]:
        png.write(folder / f"{name}.layers{k}.png", layer_picture(result_of(model, frame, "samples", k)[1], frame))


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights", type=Path)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--frames", nargs="+", help="names of frames or of scenes; the held-out frames")
    parser.add_argument("--share", type=float, default=0.1, help="of the scenes that was held out")
    parser.add_argument("--other", nargs="*", default=[], metavar="NAME=FOLDER")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args(arguments)
    model = load_model(options.weights, Layered)
    everywhere, there, shares = [], [], []
    for pair in frames.find(options.folders, frames.SAMPLES):
        if not ({pair.name, pair.scene} & set(options.frames) if options.frames else layers_crops.held_out(pair, options.share)):
            continue
        frame = subject(pair)
        images = figures(model, frame, options.other)
        everywhere.append((frame.name, errors(images, frame, frame.counted)))
        several = frame.several & frame.counted
        there.append((f"{frame.name} ({several.mean():.2f})", errors(images, frame, several)))
        near, far = fronts(model, frame)
        shares.append((frame.name, {"nearest sample": near, "farthest sample": far}))
        if options.out:
            write_pictures(options.out, frame, model)
    if not everywhere:
        raise SystemExit("evaluate_layers.py: no frames of samples")
    table("relMSE", everywhere)
    table(f"relMSE where a pixel sees depths of a ratio above {layers_crops.APART} (and the share of such pixels)", there)
    table("The front one's share of a sample there, of two layers", shares)


if __name__ == "__main__":
    main()
