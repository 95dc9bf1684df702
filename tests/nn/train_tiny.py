#!/usr/bin/env python3
"""Trains a small network on procedural frames, in a minute: the whole way from files to weights.

    train_tiny.py FOLDER

Leaves FOLDER/tiny.safetensors and FOLDER/golden.safetensors, which the C++ network is compared with. Exits with 77 where
there is no PyTorch or no reader of EXR files.
"""

import csv
import shutil
import sys
from pathlib import Path

try:
    import numpy as np
    import torch

    from synthetic import write_frames
except ImportError as error:
    print(f"skipped: training, because of {error}")
    sys.exit(77)

import curve
import evaluate
import export
import golden
import mix_export
import mix_train
import train
from blocks import NAMES
from exr import read, write
from frames import find
from mix_candidates import candidates_of
from mix_model import Mix
from model import COMPONENTS, Compositional
from weights import load_model, read_tensors, write_tensors

STEPS = 200
FALL = 0.75  # of the loss, from the first quarter of the steps to the last
BETTER = 0.9  # of the mean SMAPE of the held-out frames

torch.set_num_threads(1)


def trained(out, data, until=STEPS):
    """Trains up to a step of STEPS, which are what the learning rate follows."""
    flags = "--width 16 --batch 4 --crop 32 --warmup 20 --settle 10 --validate 50 --rate 2e-3 --threads 1"
    places = ["--data", str(data), "--out", str(out), "--steps", str(STEPS), "--until", str(until)]
    train.main([*flags.split(), *places])


def same(a, b):
    """Whether two checkpoints have the same bits, wherever tensors are."""
    if isinstance(a, torch.Tensor):
        return torch.equal(a, b)
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a if k != "hours")
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(map(same, a, b))
    return a == b


def expect(truth, words):
    if not truth:
        sys.exit(f"failed: {words}")


def check_training(folder, data):
    trained(folder / "straight", data)
    with open(folder / "straight/log.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    first, last = float(rows[0]["loss"]), float(rows[-1]["loss"])
    expect(last < FALL * first, f"loss: expected less than {FALL} of {first}, found {last}")
    noisy = {frame.name: evaluate.smape(frame.noisy, frame) for frame in map(evaluate.subject, find([data]))}
    expect({row["frame"].split("/")[0] for row in rows} == {"coffee"}, "held-out frames: expected those of coffee")
    limit = BETTER * np.mean([noisy[row["frame"]] for row in rows])
    for k in COMPONENTS:
        found = np.mean([float(x["smape"]) for x in rows if x["step"] == str(STEPS) and x["components"] == str(k)])
        print(f"held-out frames, K = {k}: SMAPE {found:.4f}, noisy {limit / BETTER:.4f}")
        expect(found < limit, f"held-out frames, K = {k}: expected a SMAPE below {limit:.4f}, found {found:.4f}")
    caches = [path.read_text() for path in (folder / "straight/cache").glob("*.json")]
    expect(len(caches) == 8 and not any("coffee" in text for text in caches), "cache: expected 8 frames, none of coffee")


def check_resuming(folder, data):
    for until in (10, 20):
        trained(folder / "halting", data, until)
    trained(folder / "whole", data, 20)
    halting, whole = (torch.load(folder / name / "checkpoint.pt") for name in ("halting", "whole"))
    expect(same(halting, whole), "a training that was halted: expected the bits of one that was not")
    expect(not same(halting["model"], halting["average"]), "weights: expected an average that differs from them")


def check_weights(folder):
    frames = ["--frames", str(folder / "frames"), "--every", "1"]
    export.main([str(folder / "straight"), str(folder / "tiny.safetensors"), *frames])
    tensors, metadata = read_tensors(folder / "tiny.safetensors")
    for k in COMPONENTS[1:]:
        coefficients = np.array(metadata[f"components.gain{k}"].split(), float)
        whole = coefficients.shape == (len(NAMES),) and np.isfinite(coefficients).all()
        expect(whole, "metadata: expected what components gain")
    expected = {name: tuple(x.shape) for name, x in Compositional(16).state_dict().items()}
    expect({name: x.shape for name, x in tensors.items()} == expected, "weights: expected the layers of the model")
    fixed = {"format": "fathom-compositional", "version": "2", "width": "16", "inputs": "24", "steps": str(STEPS)}
    expect(fixed.items() <= metadata.items(), f"metadata: expected {fixed}, found {metadata}")
    saved = torch.load(folder / "straight/checkpoint.pt")["average"]
    expect(same(dict(load_model(folder / "tiny.safetensors").state_dict()), dict(saved)), "weights: expected those of the training")
    expect("coffee" in (folder / "tiny.md").read_text(), "card: expected the held-out frames")


def check_mix(folder):
    """The mixing network with weights by chance: that what is written is what runs, for C++ to be compared with."""
    torch.manual_seed(5)
    model = Mix()
    for layer in (model.weight, model.share):
        torch.nn.init.normal_(layer.weight)
    mix_export.save(folder / "mix.safetensors", model, {"name": "random"})
    loaded = mix_export.load(folder / "mix.safetensors")
    expect(same(dict(loaded.state_dict()), dict(model.state_dict())), "mix: expected the weights that were written")
    tensors = mix_export.golden(loaded)
    expect(tensors["weight"].shape == (3, 28, 44), f"mix: expected logits of 3 candidates, found {tensors['weight'].shape}")
    write_tensors(folder / "mix_golden.safetensors", tensors)


def write_candidates(folder, data, bases=("nlm", "oidn")):
    """Means over 3x3 and 5x5 pixels, with estimates of a kind, as `fathom progressive --candidates` writes them."""
    for pair in find([data]):
        noisy, channels = read(pair.noisy)[0], {}
        for radius, base in enumerate(bases, 1):
            for c in "RGB":
                padded = np.pad(noisy[c], radius, mode="edge")
                taps = [np.roll(padded, (y, x), (0, 1)) for y in range(2 * radius + 1) for x in range(2 * radius + 1)]
                channels[f"{base}.{c}"] = np.mean(taps, 0)[2 * radius :, 2 * radius :]
                for what, part in (("error", 0.3), ("variance", 1), ("covariance", 0.1), ("spread", 0.1)):
                    channels[f"{base}.{what}.{c}"] = part * noisy[f"variance.{c}"]
            channels[f"{base}.gate"] = np.zeros_like(noisy["R"])
        out = candidates_of(folder, pair)
        out.parent.mkdir(parents=True, exist_ok=True)
        write(out, channels)


def check_mix_training(folder, data):
    """From candidates to weights and card; the mixing network starts as the rule and leaves it."""
    write_candidates(folder / "candidates", data)
    places = ["--data", str(data), "--candidates", str(folder / "candidates"), "--out", str(folder / "mixing")]
    mix_train.main([*places, *"--steps 40 --validate 20 --crop 32 --batch 2 --rate 3e-3".split()])
    with open(folder / "mixing/log.csv", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["bases"] == "nlm+oidn"]
    expect({row["frame"].split("/")[0] for row in rows} == {"coffee"}, "mix, held-out frames: expected those of coffee")
    last = [row for row in rows if row["step"] == "40"]
    expect(all(float(row["rule"]) > 0 for row in last), "mix: expected errors above 0")
    expect(any(row["mix"] != row["rule"] for row in last), "mix: expected a network that changes the rule")
    mix_export.main([str(folder / "mixing"), str(folder / "mixed.safetensors")])
    expect("coffee" in (folder / "mixed.md").read_text(), "mix, card: expected the held-out frames")
    saved = torch.load(folder / "mixing/checkpoint.pt")["average"]
    expect(same(dict(mix_export.load(folder / "mixed.safetensors").state_dict()), dict(saved)), "mix: expected its weights")


def check_golden(folder):
    golden.main([str(folder / "tiny.safetensors"), str(folder / "golden.safetensors")])
    found, _ = read_tensors(folder / "golden.safetensors")
    shapes = {name: (3, 24, 40) for name in ("colour", "output1", "output2", "output4")}
    shapes.update({"input": (24, 24, 40), "statistics": (len(NAMES),)})
    expect({name: x.shape for name, x in found.items()} == shapes, "golden: expected input, colour, statistics and three outputs")
    for k in COMPONENTS:
        expect(np.abs(found[f"output{k}"] - found["colour"]).mean() > 0.01, f"golden, K = {k}: expected a change")


def main():
    folder = Path(sys.argv[1])
    shutil.rmtree(folder, ignore_errors=True)
    write_frames(folder / "frames")
    check_training(folder, folder / "frames")
    check_resuming(folder, folder / "frames")
    check_weights(folder)
    check_golden(folder)
    check_mix(folder)
    check_mix_training(folder, folder / "frames")
    curve.main([str(folder / "straight/log.csv"), str(folder / "curve.svg")])
    evaluate.main([str(folder / "tiny.safetensors"), str(folder / "frames"), "--out", str(folder / "pictures")])


if __name__ == "__main__":
    main()
