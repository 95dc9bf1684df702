#!/usr/bin/env python3
"""Laws of the frames that the layered network is trained on, and a training of some steps: what stays the same, what is held out."""

import csv
import sys
import tempfile
import unittest
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

try:
    import numpy as np
    import torch

    import synthetic
except ImportError as error:
    print(f"skipped: training of the layered network, because of {error}")
    sys.exit(77)

import clusters
import evaluate_layers
import exr
import export_layers
import frames
import layers_augment
import layers_crops
import layers_loss
import loss
import samples
import train
import train_layers
from layers_model import Layered, Result, Samples
from planes import LIGHTS
from weights import load_model

torch.set_num_threads(1)
SPP, WIDTH, HEIGHT = 4, 44, 40


def write_samples(path, random, spp=SPP, width=WIDTH, height=HEIGHT):
    """A near card before a far wall with a hole, seen through noise; and its reference."""
    y, x = np.mgrid[0:height, 0:width]
    near = np.abs(x - width / 2) / 12 + 0.2 * random.standard_normal((spp, height, width)) < 1
    hit = ~((y < 10) & (x < 14) & ~near)
    z = np.where(near, 2.0, 6.0) + 0.01 * random.random((spp, height, width))
    albedo = np.where(near, 0.8, 0.3) * (1 + 0.3 * ((x // 4 + y // 4) % 2))
    light = albedo * random.gamma(2, 0.5, (spp, height, width))
    order = np.argsort(np.where(hit, z, np.inf), 0, kind="stable")
    take = lambda v: np.take_along_axis(v, order, 0).reshape(spp, -1).T
    there, z, light, albedo, near = take(hit), take(z), take(light), take(albedo), take(near)
    alpha = np.broadcast_to(1 / (spp - np.arange(spp)), there.shape)[there]
    channels = {"A": alpha, "Z": z[there], "coc": np.where(near, 4, 0)[there], "lens.U": random.random(len(alpha)), "lens.V": random.random(len(alpha))}
    for k, c in enumerate("RGB"):
        channels[f"diffuse.{c}"], channels[f"albedo.{c}"] = light[there] * alpha * (1 + 0.1 * k), albedo[there] * alpha
        channels[f"specular.{c}"] = 0.1 * alpha
        channels[c] = channels[f"diffuse.{c}"] + channels[f"specular.{c}"]
    for c, v in zip("XYZ", (0.0, 0.6, 0.8)):
        channels[f"N.{c}"] = v * alpha
    counts = there.sum(1).reshape(height, width)
    exr.write_deep(f"{path}.{spp}.samples.exr", counts, channels, {"fathom:spp": spp, "fathom:ppuScale": 50.0})
    covered = there.mean(1).reshape(height, width)
    reference = {"A": covered, "Z": np.full((height, width), 3.0)}
    for k, c in enumerate("RGB"):
        reference[f"specular.{c}"] = 0.1 * covered
        reference[f"diffuse.{c}"] = (there * albedo).mean(1).reshape(height, width) * (1 + 0.1 * k)
        reference[c] = reference[f"diffuse.{c}"] + reference[f"specular.{c}"]
    exr.write(f"{path}.ref.exr", reference)


def write_frames(folder):
    for number, name in enumerate(("cards", "fur")):
        (folder / name).mkdir(parents=True)
        write_samples(folder / name / "view0", np.random.default_rng(number))


class Clusters(unittest.TestCase):
    def test_bins_are_those_of_the_loop_over_a_pixel(self):
        random = np.random.default_rng(1)
        counts = random.integers(0, 7, 300)
        z = np.sort(random.choice([2, 2.01, 2.05, 3, 8], (300, 6)) + 0.01 * random.random((300, 6)), 1)
        z = np.where(np.arange(6) < counts[:, None], z, 0)
        for exponent, first in ((1, 0), (2, 1)):
            found, seen = clusters.labels(z, counts, 40, exponent, first), set()
            for p, n in enumerate(counts):
                bin_, total = 1, 0.0
                for k in range(n):
                    if k:
                        total += (z[p, k] - z[p, k - 1]) * 40 / z[p, k - 1]
                        if total > (bin_ + first) ** exponent:
                            bin_, total = bin_ + 1, 0.0
                    self.assertEqual(found[p, k], bin_ - 1)
                seen.add(bin_)
            self.assertGreater(len(seen), 2)

    def test_bins_have_the_mean_and_its_variance(self):
        random = np.random.default_rng(2)
        values = random.random((1, 5, clusters.PHYSICAL)).astype(np.float32)
        bins, pixel = clusters.gathered(values, np.array([4]), np.array([[0, 0, 0, 1, 1]]))
        np.testing.assert_allclose(bins[0, : clusters.PHYSICAL], values[0, :3].mean(0), rtol=1e-6)
        np.testing.assert_allclose(bins[1, : clusters.PHYSICAL], values[0, 3], rtol=1e-6)
        variance = values[0, :3, 3:6].astype(float).var(0, ddof=1).mean() / 3
        np.testing.assert_allclose(bins[0, samples.WHERE["noise"]][1], np.sqrt(variance), rtol=1e-5)
        np.testing.assert_array_equal(bins[:, samples.WHERE["count"]][:, 0], [3, 1])
        self.assertEqual(bins[1, samples.WHERE["noise"]].any(), False)
        np.testing.assert_array_equal(pixel, [0, 0])

    def test_some_samples_of_all_and_misses_among_them(self):
        random = np.random.default_rng(3)
        counts = np.repeat([0, 3, 8], 4000)
        values = np.where(np.arange(8) < counts[:, None], np.arange(1, 9), 0)[:, :, None].astype(np.float16)
        some = clusters.chosen(random, values, 4)
        self.assertEqual((some.shape, some.dtype), ((12000, 4, 1), np.float16))
        left = (some[:, :, 0] > 0).sum(1)
        np.testing.assert_array_equal(left[:4000], 0)
        np.testing.assert_array_equal(left[8000:], 4)
        self.assertAlmostEqual(left[4000:8000].mean(), 1.5, delta=0.05)
        self.assertTrue((np.diff(some[8000:, :, 0]) > 0).all())
        self.assertAlmostEqual(some[8000:].astype(float).mean(), 4.5, delta=0.05)
        kept = np.arange(4) < left[:, None]
        self.assertTrue((some[kept] > 0).all())
        self.assertIs(clusters.chosen(random, values, 8), values)

    def test_raw_samples_are_few(self):
        random, drawn = np.random.default_rng(4), {}
        for form in layers_augment.FORMS:
            for spp in (1, 8, 64, 100):
                drawn[form, spp] = {layers_augment.drawn_count(random, form, spp) for _ in range(300)}
        for (form, spp), counts in drawn.items():
            most = min(spp, layers_augment.MOST_RAW if form == "samples" else 64)
            self.assertEqual(max(counts), most, (form, spp))
            self.assertEqual(len(counts), 1 if spp == 1 else int(np.log2(most)), (form, spp))


class Data(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = Path(self.temporary.name)
        self.addCleanup(self.temporary.cleanup)
        write_frames(self.folder / "frames")

    def cache(self, size=32):
        cache = layers_crops.Cache(self.folder / "cache", [self.folder / "frames"], size)
        cache.refresh()
        return cache

    def test_deep_files_come_back(self):
        counts, channels, attributes = exr.read_deep(self.folder / f"frames/cards/view0.{SPP}.samples.exr")
        self.assertEqual(counts.shape, (HEIGHT, WIDTH))
        self.assertEqual(attributes, {"fathom:spp": SPP, "fathom:ppuScale": 50})
        self.assertTrue(all(len(x) == counts.sum() for x in channels.values()))
        self.assertEqual((counts.min(), counts.max()), (0, SPP))
        weight = samples.effective(channels["A"].astype(float), counts.ravel())
        np.testing.assert_allclose(weight, 1 / SPP, rtol=1e-5)
        with self.assertRaises(OSError):
            exr.read_deep(self.folder / "frames/cards/view0.ref.exr")

    def test_what_is_held_out(self):
        self.assertEqual([frame.name for frame in self.cache().frames], [f"cards/view0.{SPP}"])
        (self.folder / "frames/staircase2.samples.exr").touch()
        (self.folder / "frames/staircase2.ref.exr").touch()
        pairs = [pair for pair in frames.find([self.folder / "frames"], frames.SAMPLES) if layers_crops.held_out(pair, 0)]
        self.assertEqual([pair.name for pair in pairs], [f"fur/view0.{SPP}", "staircase2"])

    def test_no_environment_counts_where_samples_know_nothing_of_it(self):
        light, alpha = np.zeros((3, 2, 2)), np.array([[0, 0.5], [1, 1.0]])
        light[:, 1] = 1
        np.testing.assert_array_equal(layers_crops.counted(light, alpha), 1)
        light[:, 0, 0] = 0.3
        np.testing.assert_array_equal(layers_crops.counted(light, alpha), [[0, 0], [1, 1]])

    def test_a_variation_keeps_the_light_of_the_pixel(self):
        frame = self.cache().frames[0]
        pixels, targets = frame.crop(3, 5, 32)
        targets = np.array(targets)
        targets[..., 3:6], targets[..., 6:9] = (pixels[..., k : k + 3].astype(np.float32).sum(2) / SPP for k in (0, 3))
        targets[..., :3] = targets[..., 3:6] + targets[..., 6:9]
        kinds, lights = set(), set()
        layers_augment.COUNTS, counts = {SPP: 1.0}, layers_augment.COUNTS
        self.addCleanup(setattr, layers_augment, "COUNTS", counts)
        for seed in range(40):
            (values, weight, light, z, divisor, pixel), target = layers_augment.varied(np.random.default_rng(seed), frame, pixels, targets.copy())
            self.assertTrue(np.isfinite(values).all() and (np.diff(pixel) >= 0).all() and (z > 0).all())
            for c in range(3):
                np.testing.assert_allclose(np.bincount(pixel, weight * (divisor * light)[:, c], 32 * 32), target[..., c].ravel(), rtol=1e-4, atol=1e-5)
            np.testing.assert_allclose(np.bincount(pixel, weight, 32 * 32).max(), 1, rtol=1e-5)
            kinds.add((len(pixel), bool(values[:, 13].any()), bool(values[:, 9:12].any())))
            lights.add((bool(values[:, :3].any()), bool(values[:, 3:6].any())))
        self.assertGreater(len(kinds), 4)
        self.assertEqual(lights, {(True, True), (True, False), (False, True)})

    def test_a_panel_gives_light_and_reflects_none(self):
        pixels, targets = (np.array(x, np.float32) for x in self.cache().frames[0].crop(3, 5, 32))
        there = pixels[..., samples.WHERE["depth"].start] > 0
        targets[..., -2] = there.mean(2)
        before, aims = pixels.copy(), targets.copy()
        shares = []
        for seed in range(12):
            pixels[:], targets[:] = before, aims
            layers_augment.with_panel(np.random.default_rng(seed), pixels, targets, 2.0)
            inside = (pixels != before).any((2, 3))
            shares.append(inside.mean())
            np.testing.assert_array_equal(targets[~inside & there.any(2)], aims[~inside & there.any(2)])
            hit = there & inside[..., None]
            self.assertFalse(pixels[hit][:, samples.WHERE["diffuse"]].any() or pixels[hit][:, samples.WHERE["albedo"]].any())
            light = pixels[hit][0, samples.WHERE["specular"]]
            np.testing.assert_array_equal(pixels[hit][:, samples.WHERE["specular"]], np.tile(light, (hit.sum(), 1)))
            np.testing.assert_array_equal(pixels[..., samples.WHERE["depth"]], before[..., samples.WHERE["depth"]])
            for k, name in enumerate(LIGHTS):
                expected = targets[inside][:, -2:-1] * light * (name != "diffuse")
                np.testing.assert_allclose(targets[inside][:, 3 * k : 3 * k + 3], expected, rtol=1e-5)
        self.assertGreater(max(shares), 0.2)
        self.assertLess(min(shares), 0.2)

    def test_a_backdrop_lights_what_was_empty(self):
        pixels, targets = (np.array(x, np.float32) for x in self.cache().frames[0].crop(3, 5, 32))
        pixels[10:13, :, 1:] = 0  # all but the nearest missed in a strip
        there = pixels[..., samples.WHERE["depth"].start] > 0
        targets[..., -2], targets[..., -1] = there.mean(2), 1
        before, aims = pixels.copy(), targets.copy()
        shares = set()
        for seed in range(12):
            pixels[:], targets[:] = before, aims
            layers_augment.with_backdrop(np.random.default_rng(seed), pixels, targets, 2.0)
            added = (pixels[..., samples.WHERE["depth"].start] > 0) & ~there
            shares.add(round(added.sum() / (~there).sum(), 2))
            np.testing.assert_array_equal(pixels[there], before[there])
            self.assertGreater(pixels[added][:, samples.WHERE["depth"]].min(), before[..., samples.WHERE["depth"]].max())
            light = pixels[added][0, samples.WHERE["specular"]]
            self.assertTrue(0.25 * 0.5 / 2 <= light.min() and light.max() <= 2**4.5 / 2)
            more = added.mean(2)[..., None] * light
            for k, name in enumerate(LIGHTS):
                np.testing.assert_allclose(targets[..., 3 * k : 3 * k + 3] - aims[..., 3 * k : 3 * k + 3], more * (name != "diffuse"), rtol=1e-4, atol=1e-5)
            np.testing.assert_allclose(targets[..., -2], (there | added).mean(2), rtol=1e-5)
        self.assertIn(1, shares)
        self.assertGreater(len(shares), 2)
        pixels[:], targets[:] = before, aims
        targets[0, 0, -1] = 0  # an environment is seen
        layers_augment.with_backdrop(np.random.default_rng(1), pixels, targets, 2.0)
        np.testing.assert_array_equal(pixels, before)

    def test_places_on_the_lens_turn_with_the_picture(self):
        lens = np.float32([0.75, 0.9])  # to the right and up
        np.testing.assert_allclose(layers_augment.turned_lens(lens, (False, True), False), [0.25, 0.9])
        np.testing.assert_allclose(layers_augment.turned_lens(lens, (True, False), False), [0.75, 0.1], rtol=1e-6)
        np.testing.assert_allclose(layers_augment.turned_lens(lens, (False, False), True), [0.1, 0.25], rtol=1e-6)

    def test_batches_repeat(self):
        batches = layers_augment.Batches(self.cache(), 32, 1)
        (a, x), (b, y), (c, _) = (batches.batch(step, 3) for step in (7, 7, 8))
        for one, two in zip(a[:-1], b[:-1]):
            self.assertTrue(torch.equal(one, two))
        np.testing.assert_array_equal(x, y)
        self.assertFalse(a.inputs.shape == c.inputs.shape and torch.equal(a.inputs, c.inputs))

    def train(self, name, until):
        flags = "--width 8 --batch 4 --crop 32 --steps 8 --warmup 2 --validate 4 --settle 4 --threads 1"
        places = ["--data", str(self.folder / "frames"), "--out", str(self.folder / name), "--until", str(until)]
        train_layers.main([*flags.split(), *places])
        return torch.load(self.folder / name / "checkpoint.pt")

    def test_a_training_that_was_halted_has_the_bits_of_one_that_was_not(self):
        self.train("halting", 3)
        halting, whole = self.train("halting", 8), self.train("whole", 8)
        for name in ("model", "average"):
            self.assertTrue(all(torch.equal(halting[name][k], x) for k, x in whole[name].items()))
        self.assertEqual(halting["losses"], whole["losses"])
        with open(self.folder / "whole/log.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual({row["frame"] for row in rows}, {f"fur/view0.{SPP}"})
        self.assertEqual(len(rows), 2 * len(train_layers.LOGGED))
        export_layers.main([str(self.folder / "whole"), str(self.folder / "layers.safetensors")])
        exported = load_model(self.folder / "layers.safetensors", Layered).state_dict()
        self.assertTrue(all(torch.equal(x, whole["average"][k]) for k, x in exported.items()))
        for start in ("layers.safetensors", "whole/checkpoint.pt"):
            flags = ["--data", self.folder / "frames", "--out", self.folder / "further", "--width", 8, "--crop", 32, "--start", self.folder / start]
            begun = train_layers.Training(train.options([str(x) for x in flags])).model.state_dict()
            self.assertTrue(all(torch.equal(x, begun[k]) for k, x in exported.items()))
        self.assertIn("fur/view0", (self.folder / "layers.md").read_text())
        evaluate_layers.main([str(self.folder / "layers.safetensors"), str(self.folder / "frames"), "--out", str(self.folder / "pictures")])
        self.assertEqual(len(list((self.folder / "pictures").glob("*.png"))), 3)


class Ahead(unittest.TestCase):
    def test_batches_are_those_of_their_step_and_of_the_frames_at_that_time(self):
        training, frames = train_layers.Training.__new__(train_layers.Training), [0]
        training.settings = SimpleNamespace(batch=4, validate=3)
        training.batches = SimpleNamespace(batch=lambda step, count: (step, count, len(frames)))
        training.beside, training.ahead = ThreadPoolExecutor(1), None
        for training.step in range(9):
            self.assertEqual(training.batch(), (training.step, 4, len(frames)))
            if training.ahead:
                training.ahead.result()
            if (training.step + 1) % 3 == 0:
                frames.append(0)


class Loss(unittest.TestCase):
    def test_a_part_of_the_light_errs_as_the_whole_does(self):
        part, reference, other = torch.rand(3, 2, 3, 8, 8, generator=torch.Generator().manual_seed(1))
        for error in (loss.smape, loss.relative_square):
            self.assertAlmostEqual(error(part, reference, other).item(), error(part + other, reference + other).item(), places=5)
            self.assertLess(error(part, reference, other).item(), error(part, reference).item())

    def result(self, places, depth, pixel):
        partition = torch.nn.functional.one_hot(torch.tensor(places), 2).float()
        listed = Samples(None, torch.ones(len(places)), None, torch.tensor(depth), None, torch.tensor(pixel), (1, 4, 16))
        return Result(*[None] * 5, partition, *[None] * 3), listed

    def order(self, *given):
        return layers_loss.order(*self.result(*given)).item()

    def test_order_of_depths(self):
        self.assertAlmostEqual(self.order([0, 1], [1.0, 2.0], [3, 3]), 0)
        self.assertAlmostEqual(self.order([1, 0], [1.0, 2.0], [3, 3]), 2, places=5)
        self.assertAlmostEqual(self.order([1, 1], [1.0, 2.0], [3, 3]), 1, places=5)
        self.assertAlmostEqual(self.order([1, 0], [2.0, 1.0], [3, 5]), 0)  # of neighbours
        self.assertAlmostEqual(self.order([0, 1], [2.0, 1.0], [3, 5]), 2, places=5)
        self.assertAlmostEqual(self.order([1, 0], [1.0, 2.0], [3, 12]), 0)  # too far apart
        self.assertAlmostEqual(self.order([1, 0], [1.0, 2.0], [15, 16]), 0)  # of different rows
        self.assertAlmostEqual(self.order([0, 0], [1.0, 1.0], [3, 3]), 0)  # of one surface

    def test_decision(self):
        result, listed = self.result([0, 1], [1.0, 2.0], [3, 3])
        self.assertAlmostEqual(layers_loss.undecided(result, listed).item(), 0, places=5)
        even = result._replace(partition=torch.full((2, 2), 0.5))
        self.assertAlmostEqual(layers_loss.undecided(even, listed).item(), 0.5, places=5)


if __name__ == "__main__":
    unittest.main()
