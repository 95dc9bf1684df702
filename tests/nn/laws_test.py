#!/usr/bin/env python3
"""Laws of the training's parts: what stays the same, what must be missed, what must be refused."""

import sys
import tempfile
import unittest
from pathlib import Path

try:
    import numpy as np
    import torch

    import synthetic
except ImportError as error:
    print(f"skipped: laws of the training, because of {error}")
    sys.exit(77)

import augment
import crops
import exr
import frames
import loss
import planes
import weights
from model import COMPONENTS, TAPS, Compositional, Gather, Result, denoised, gigaflops_per_megapixel
from widen import widened

torch.set_num_threads(1)


def noisy_channels(spp=8, width=48, height=40):
    random = np.random.default_rng(5)
    return {k: np.float32(v) for k, v in synthetic.noisy(random, synthetic.scene(random, width, height), spp).items()}


def network_input(channels, name="diffuse"):
    stack, given = planes.measure(channels)
    return planes.planes(stack, given, name, planes.exposure(planes.component(channels, "rgb")))


class Network(unittest.TestCase):
    def setUp(self):
        torch.manual_seed(1)
        self.model = Compositional(16)
        self.planes, self.colour = torch.randn(2, 24, 16, 20), torch.rand(2, 3, 16, 20)

    def test_gather_has_the_gradient_of_the_sum_that_it_computes(self):
        weights = torch.rand(2, TAPS, 5, 6, dtype=torch.double, requires_grad=True)
        padded = torch.rand(2, 3, 9, 10, dtype=torch.double, requires_grad=True)
        self.assertTrue(torch.autograd.gradcheck(Gather.apply, (weights, padded)))

    def test_a_kernel_of_one_tap_moves_the_image(self):
        weights = torch.zeros(1, TAPS, 4, 6)
        weights[:, 3 * 5 + 0] = 1  # one row down, two columns to the left
        padded = torch.rand(1, 3, 8, 10)
        torch.testing.assert_close(Gather.apply(weights, padded), padded[:, :, 3:7, 0:6])

    def test_constant_light_stays(self):
        flat = torch.full_like(self.colour, 0.7)
        torch.testing.assert_close(self.model(self.planes, flat, 1), flat)

    def test_light_is_split_without_loss(self):
        for k in COMPONENTS:
            masks = self.model.result(self.planes, self.colour, k).masks
            self.assertEqual(masks.shape, (k, 2, 3, 16, 20))
            torch.testing.assert_close(masks.sum(0), torch.ones_like(self.colour))
            self.assertGreaterEqual(float(masks.min()), 0)

    def test_frames_of_a_batch_do_not_mix(self):
        for k in COMPONENTS:
            both = self.model(self.planes, self.colour, k)
            for i in range(2):
                torch.testing.assert_close(both[i : i + 1], self.model(self.planes[i : i + 1], self.colour[i : i + 1], k))

    def test_sides_of_any_length(self):
        whole = denoised(self.model, self.planes[:, :, :13, :19], self.colour[:, :, :13, :19], 2)
        self.assertEqual(whole.shape, (2, 3, 13, 19))

    def test_a_widened_network_computes_the_same_with_copies_that_differ(self):
        wide = widened(self.model)
        self.assertEqual(wide.width, 2 * self.model.width)
        for k in COMPONENTS:
            torch.testing.assert_close(wide(self.planes, self.colour, k), self.model(self.planes, self.colour, k))
        first, second = wide.denoise.merge0.weight[: self.model.width, : 2 * self.model.width].chunk(2, 1)
        torch.testing.assert_close(first + second, self.model.denoise.merge0.weight[:, : self.model.width])
        self.assertGreater(float((first - second).abs().max()), 0.01)

    def test_work_is_counted_as_in_the_layers(self):
        for width in (16, 32):
            model, operations = Compositional(width), [0]

            def count(layer, _, output):
                operations[0] += 2 * layer.weight.numel() * output.shape[0] * output[0, 0].numel()

            for layer in model.modules():
                if isinstance(layer, torch.nn.Conv2d):
                    layer.register_forward_hook(count)
            for k in COMPONENTS:
                operations[0] = 0
                model(self.planes[:1], self.colour[:1], k)
                applied = 2 * k * 3 * TAPS * (1 + 1 / 4 + 1 / 16)
                self.assertAlmostEqual(gigaflops_per_megapixel(width, k), operations[0] / 320000 + applied / 1000)


class Planes(unittest.TestCase):
    def test_exposure_of_even_light(self):
        self.assertAlmostEqual(planes.exposure(np.full((3, 13, 9), 0.4)), 0.5)
        self.assertEqual(planes.exposure(np.zeros((3, 13, 9))), 1)

    def test_exposure_is_by_blocks_and_lifts_dark_ones(self):
        light = np.full((3, 8, 24), 4.0)
        light[:, :, 8:16], light[:, :, 16:] = 1e-9, 0
        dark = 1e-3 * (4 + 1e-9) / 2
        self.assertAlmostEqual(planes.exposure(light), 0.2 / np.sqrt(4 * dark), places=6)

    def test_the_unit_of_light_and_of_length_do_not_matter(self):
        channels = noisy_channels()
        scaled = {}
        for name, value in channels.items():
            feature = name.startswith(("albedo", "N.", "A"))
            power = 2 if name.startswith("variance") else 1
            scaled[name] = value if feature else value * 4.0**power
        for name in planes.LIGHTS:
            for a, b in zip(network_input(channels, name), network_input(scaled, name)):
                np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-6)

    def test_what_each_plane_holds(self):
        channels = {name: np.full((8, 8), value, np.float32) for name, value in {
            "R": 0.2, "G": 0.4, "B": 0.6, "diffuse.R": 0.1, "diffuse.G": 0.5, "diffuse.B": 0.3, "A": 0.5, "Z": 4.0,
            "albedo.R": 0.1, "albedo.G": 0.2, "albedo.B": 1.3, "N.X": -2.0, "N.Y": 0.5, "N.Z": 0.1,
            "variance.R": 0.01, "variance.G": 0.04, "variance.B": 0.09, "variance.Z": 4.0,
            "variance.albedo.R": 0.03, "variance.albedo.G": 0.0, "variance.albedo.B": 0.0,
            "half0.diffuse.R": 0.2, "half0.diffuse.G": 0.5, "half0.diffuse.B": 0.3,
            "half1.diffuse.R": 0.1, "half1.diffuse.G": 0.5, "half1.diffuse.B": 0.3,
        }.items()}  # fmt: skip
        inputs, colour, divisor = network_input(channels)  # the exposure is 0.5
        np.testing.assert_allclose(divisor[:, 0, 0], [0.12, 0.22, 1.02], rtol=1e-6)
        divided = np.array([0.05, 0.25, 0.15]) / divisor[:, 0, 0]
        np.testing.assert_allclose(colour[:, 0, 0], divided, rtol=1e-6)
        mean = (divided.mean() + 0.01) * (0.12 + 0.22 + 1.02) / 3
        deviation = 0.5 * np.sqrt(0.14 / 3) / mean
        expected = [
            *np.log1p(divided), 0.1, 0.2, 1, -1, 0.5, 0.1, 0.5, 0.5, np.log1p(deviation), 0.1, 0, 0.5,
            np.log1p(0.5 * 0.1 / 3 / mean), *np.log1p([0.05, 0, 0.15]), 1, 1, 1, 1, 1,
        ]  # fmt: skip
        np.testing.assert_allclose(inputs[:, 3, 5], expected, rtol=1e-5, atol=1e-7)
        without = {name: value for name, value in channels.items() if not name.startswith("half")}
        halves = np.log1p(0.5 * 1.6 * (0.1 + 0.2 + 0.3) / 3 / mean)
        np.testing.assert_allclose(network_input(without)[0][15], halves, rtol=1e-5)

    def test_colour_alone(self):
        channels = {name: value for name, value in noisy_channels().items() if name in "RGB"}
        channels["R"][3, 4], channels["G"][3, 4] = np.nan, np.inf
        inputs, colour, divisor = network_input(channels, "rgb")
        self.assertTrue((divisor == 1).all())
        self.assertTrue(np.isfinite(inputs).all())
        self.assertEqual(colour[0, 3, 4], 0)
        self.assertTrue((inputs[10] == 1).all())
        self.assertFalse(inputs[[*range(3, 10), *range(11, 24)]].any())


class Variations(unittest.TestCase):
    def test_a_crop_without_noise_has_none_in_any_variation(self):
        stack, given = planes.measure(noisy_channels())
        targets = {name: stack[planes.WHERE[name]] for name in planes.LIGHTS}
        seen = set()
        for seed in range(60):
            inputs, colour, divisor, target = augment.varied(np.random.default_rng(seed), stack, targets, given, 0.7)
            np.testing.assert_allclose(colour * divisor, target, rtol=1e-6)
            self.assertTrue(np.isfinite(inputs).all())
            seen.add((inputs.shape, tuple(inputs[19:24, 0, 0])))
        self.assertGreater(len(seen), 10)  # both ways round, all kinds, with and without features

    def test_normals_turn_with_the_picture(self):
        stack, given = planes.measure(noisy_channels())
        targets = {name: stack[planes.WHERE[name]] for name in planes.LIGHTS}
        lengths = np.sort(np.linalg.norm(stack[planes.WHERE["normal"]], axis=0).ravel())
        for seed in range(20):
            inputs, *_ = augment.varied(np.random.default_rng(seed), stack, targets, given, 0.7)
            if inputs[20].any():
                found = np.sort(np.linalg.norm(inputs[6:9], axis=0).ravel())
                np.testing.assert_allclose(found, lengths, rtol=1e-5)

    def test_a_pattern_leaves_the_noise_in_proportion(self):
        stack, _ = planes.measure(noisy_channels())
        targets = {name: 2 * stack[planes.WHERE[name]] for name in planes.LIGHTS}
        where = planes.WHERE
        albedos = set()
        for seed in range(20):
            changed, after = augment.patterned(np.random.default_rng(seed), stack, targets)
            pattern = changed[where["rgb"]][0] / stack[where["rgb"]][0]
            self.assertGreater(pattern.std(), 0.1)
            self.assertTrue(0.5 < pattern.mean() < 2)
            for light in planes.LIGHTS:
                np.testing.assert_allclose(after[light], 2 * changed[where[light]], rtol=1e-5)
                for layer in ("noise", "root", "halves"):
                    layer = where[f"{light}.{layer}"]
                    np.testing.assert_allclose(changed[layer], stack[layer] * pattern, rtol=1e-4, atol=1e-7)
            for layer in ("alpha", "depth", "normal.noise"):
                np.testing.assert_array_equal(changed[where[layer]], stack[where[layer]])
            albedos.add(bool((changed[where["albedo"]] != stack[where["albedo"]]).any()))
        self.assertEqual(albedos, {False, True})

    def test_loss(self):
        a, b = torch.full((1, 3, 4, 4), 0.5), torch.full((1, 3, 4, 4), 0.3)
        self.assertAlmostEqual(float(loss.smape(a, b)), 0.2 / 0.81, places=6)
        self.assertEqual(float(loss.mask_variance(torch.full((4, 1, 3, 4, 4), 0.25))), 0)
        self.assertAlmostEqual(float(loss.mask_variance(torch.tensor([1.0, 0.0]).reshape(2, 1, 1, 1, 1))), 0.25)

    def test_loss_is_that_of_the_light_with_its_albedo(self):
        a, b, divisor = (torch.full((1, 3, 4, 4), x) for x in (0.5, 0.3, 0.2))
        result = Result([a, loss.half_size(a)], [torch.ones(1)], [torch.zeros(1)], [torch.zeros(1)])
        error, total = loss.loss(result, divisor, b, settling=False)
        fine, coarse = loss.smape(0.2 * a, b), loss.smape(a, b / 0.2)
        self.assertAlmostEqual(float(error), float(fine), places=6)
        expected = fine + loss.SQUARED * loss.relative_square(0.2 * a, b) + loss.COARSE[0] * coarse
        self.assertAlmostEqual(float(total), float(expected), places=6)


class Files(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = Path(self.temporary.name)
        self.addCleanup(self.temporary.cleanup)

    def test_pairs_and_scenes(self):
        for name in ("attic.flat.exr", "attic.ref.exr", "lone.flat.exr", "fur.0001.8.flat.exr", "fur.0001.ref.exr"):
            (self.folder / name).touch()
        (self.folder / "hall").mkdir()
        for name in ("a.ref.exr", "a.4.flat.exr", "a.16.flat.exr", "a.deep.exr", "b.flat.exr"):
            (self.folder / "hall" / name).touch()
        found = {(pair.name, pair.scene, pair.reference.name) for pair in frames.find([self.folder])}
        expected = {("attic", "attic", "attic.ref.exr"), ("fur.0001.8", "fur.0001", "fur.0001.ref.exr")}
        expected |= {(f"hall/a.{spp}", "hall", "a.ref.exr") for spp in (4, 16)}
        self.assertEqual(found, expected)

    def test_split(self):
        self.assertTrue(all(map(frames.held_out, frames.HELD_OUT)))
        names = [f"scene{i}" for i in range(1000)]
        self.assertFalse(any(map(frames.held_out, names)))
        self.assertAlmostEqual(np.mean([frames.held_out(name, 0.2) for name in names]), 0.2, delta=0.04)

    def test_images_come_back(self):
        channels = noisy_channels()
        exr.write(self.folder / "a.exr", channels)
        found, spp = exr.read(self.folder / "a.exr")
        self.assertIsNone(spp)
        self.assertEqual(found.keys(), channels.keys())
        for name, value in channels.items():
            np.testing.assert_array_equal(found[name], value)

    def test_a_cache_takes_in_what_appears_and_what_is_complete_later(self):
        synthetic.write_frames(self.folder / "frames", scenes=("cards", "fur"), views=1)
        first, second = f"cards/view0.{synthetic.SPP}", f"cards/view0.{2 * synthetic.SPP}"
        noisy = self.folder / f"frames/{second}.flat.exr"
        complete = noisy.read_bytes()
        noisy.write_bytes(complete[: len(complete) // 2])
        refused = []
        cache = crops.Cache(self.folder / "cache", [self.folder / "frames"], 32, log=refused.append)
        cache.refresh()
        self.assertEqual([frame.name for frame in cache.frames], [first])
        self.assertEqual(len(refused), 1)
        noisy.write_bytes(complete)
        cache.refresh()
        self.assertEqual([frame.name for frame in cache.frames], [first, second])
        stack, targets = cache.frames[0].crop(3, 5, 32)
        whole, _ = crops.prepare(frames.find([self.folder / "frames"])[0], 32)
        np.testing.assert_array_equal(np.concatenate([stack, *targets.values()]), np.float32(whole[:, 3:35, 5:37]))

    def test_batches_repeat(self):
        synthetic.write_frames(self.folder / "frames", scenes=("cards", "fur"), views=1)
        cache = crops.Cache(self.folder / "cache", [self.folder / "frames"], 32)
        cache.refresh()
        a, b, c = (augment.Batches(cache, 32, 1).batch(step, 3) for step in (7, 7, 8))
        for x, y, z in zip(a, b, c):
            np.testing.assert_array_equal(x, y)
            self.assertFalse(np.array_equal(x, z))

    def test_dull_crops_are_rare(self):
        interest = np.zeros((64, 64))
        interest[:, 48:] = 1
        accepted = crops.acceptance(interest, 16)
        self.assertEqual(accepted.shape, (7, 7))
        self.assertTrue((accepted[:, :4] == crops.LEAST).all() and (accepted[:, 6] == 1).all())

    def test_weights_come_back_and_cut_files_are_refused(self):
        path = self.folder / "a.safetensors"
        tensors = {"b.weight": np.arange(6, dtype=np.float32).reshape(2, 3), "a": np.float32([4])}
        weights.write_tensors(path, tensors, {"format": "x"})
        found, metadata = weights.read_tensors(path)
        self.assertEqual(metadata, {"format": "x"})
        for name, value in tensors.items():
            np.testing.assert_array_equal(found[name], value)
        data = path.read_bytes()
        for length in range(len(data)):
            path.write_bytes(data[:length])
            with self.assertRaises(ValueError):
                weights.read_tensors(path)

    def test_weights_of_another_network_are_refused(self):
        path = self.folder / "a.safetensors"
        model = Compositional(16)
        weights.save_model(path, model, {})
        torch.testing.assert_close(dict(weights.load_model(path).state_dict()), dict(model.state_dict()))
        tensors, metadata = weights.read_tensors(path)
        del tensors["denoise.kernel1.bias"]
        weights.write_tensors(path, tensors, metadata)
        with self.assertRaisesRegex(RuntimeError, "denoise.kernel1.bias"):
            weights.load_model(path)
        weights.write_tensors(path, tensors, {**metadata, "version": "1"})
        with self.assertRaisesRegex(ValueError, "version"):
            weights.load_model(path)


if __name__ == "__main__":
    unittest.main()
