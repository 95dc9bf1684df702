#!/usr/bin/env python3
"""Laws of the layered network and of what it reads: layers_test.py FOLDER.

Leaves FOLDER/layers.safetensors and FOLDER/layers_golden.safetensors, which the C++ network is compared with.
"""

import sys
import unittest
from pathlib import Path

try:
    import numpy as np
    import torch

    sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "nn" / "train"))
    from model import TAPS
except ImportError as error:
    print(f"skipped: laws of the layered network, because of {error}")
    sys.exit(77)

import golden_layers
import samples
import weights
from layers_model import FLOOR, INPUTS, LAYERS, OWN, Layered, Samples, Splat, composited, gigaflops_per_megapixel
from samples import LEAST_ALBEDO

torch.set_num_threads(1)
FOLDER = Path(sys.argv.pop()) if len(sys.argv) > 1 and not sys.argv[-1].startswith("-") else Path(".")
SHAPE = (2, 16, 20)
PIXELS = SHAPE[0] * SHAPE[1] * SHAPE[2]


def some_samples(each=4):
    """Ragged samples whose weights leave some of each pixel open; every fifth pixel has none."""
    pixel = torch.arange(PIXELS).repeat_interleave(each)
    pixel = pixel[(pixel % 5 != 0) & (torch.rand(len(pixel)) < 0.8)]
    n = len(pixel)
    light, divisor = torch.rand(n, 3), 0.1 + torch.rand(n, 3)
    return Samples(torch.randn(n, INPUTS), torch.full((n,), 1 / each), light, 1 + torch.rand(n), divisor, pixel, SHAPE)


def decided(model, factor=30):
    """Makes partitions and kernels of a new network less even."""
    with torch.no_grad():
        for name, x in model.named_parameters():
            if name.endswith(".2.weight"):
                x.mul_(factor)
    return model


class Network(unittest.TestCase):
    def setUp(self):
        torch.manual_seed(2)
        self.model, self.samples = decided(Layered(16)), some_samples()

    def test_splat_has_the_gradient_of_what_it_computes(self):
        kernels = torch.rand(2, TAPS, 5, 6, dtype=torch.double, requires_grad=True)
        values = torch.rand(2, 3, 5, 6, dtype=torch.double, requires_grad=True)
        self.assertTrue(torch.autograd.gradcheck(Splat.apply, (kernels, values)))

    def test_a_kernel_of_one_tap_moves_the_image(self):
        kernels = torch.zeros(1, TAPS, 4, 6)
        kernels[:, 3 * 5 + 0] = 1  # to one row further down, two columns to the left
        values = torch.rand(1, 3, 4, 6)
        expected = torch.zeros(1, 3, 4, 6)
        expected[:, :, 1:, :4] = values[:, :, :3, 2:]
        torch.testing.assert_close(Splat.apply(kernels, values), expected)

    def test_shares_sum_to_one_and_small_ones_are_none(self):
        for k in LAYERS:
            partition = self.model.result(self.samples, k).partition
            self.assertEqual(partition.shape, (len(self.samples.pixel), k))
            torch.testing.assert_close(partition.sum(1), torch.ones(len(partition)))
            self.assertGreaterEqual(partition.min().item(), 0)
            if k > 1:
                self.assertTrue(((partition == 0).float().mean() > 0.1) and (partition > FLOOR).any())

    def test_layers_in_the_order_of_compositing_give_the_result(self):
        for k in LAYERS:
            result = self.model.result(self.samples, k)
            self.assertEqual(result.radiance.shape, (k, SHAPE[0], 3, *SHAPE[1:]))
            self.assertTrue((result.opacity >= 0).all() and (result.opacity <= 1).all())
            colour, alpha = composited(result.radiance, result.opacity)
            torch.testing.assert_close(colour, result.colour)
            torch.testing.assert_close(alpha, result.alpha)

    def test_even_light_stays_where_all_is_hit(self):
        n = 3 * PIXELS
        even = Samples(torch.randn(n, INPUTS), torch.full((n,), 1 / 3), torch.full((n, 3), 0.7), torch.rand(n) + 1, torch.ones(n, 3),
                       torch.arange(PIXELS).repeat_interleave(3), SHAPE)  # fmt: skip
        for k in LAYERS:
            result = self.model.result(even, k)
            torch.testing.assert_close(result.radiance, 0.7 * result.opacity.expand_as(result.radiance))
            torch.testing.assert_close(result.colour, 0.7 * result.alpha.expand_as(result.colour))
        torch.testing.assert_close(self.model.result(even, 1).alpha, torch.ones(SHAPE[0], 1, *SHAPE[1:]))

    def test_samples_that_miss_leave_the_layers_behind_open(self):
        """Occupancy: with the near half of each pixel's samples in front, what is behind is not thinner for it."""
        near = torch.arange(2 * PIXELS) % 2 == 0
        halves = Samples(torch.randn(2 * PIXELS, INPUTS), torch.full((2 * PIXELS,), 0.25), torch.where(near, 0.2, 0.8)[:, None].expand(-1, 3).contiguous(),
                         torch.where(near, 1.0, 5.0), torch.ones(2 * PIXELS, 3), torch.arange(PIXELS).repeat_interleave(2), SHAPE)  # fmt: skip
        model = decided(Layered(16), 1)
        model.shares = lambda *_: torch.stack([near, ~near], 1).float()
        with torch.no_grad():
            for x in (model.kernel0, model.kernel1, model.kernel2):  # kernels that are the same everywhere
                getattr(x, "2").weight.zero_()
        result = model.result(halves, 2)
        for k, (alpha, light, z) in enumerate(((0.25, 0.2, 1.0), (1 / 3, 0.8, 5.0))):
            torch.testing.assert_close(result.opacity[k], torch.full_like(result.opacity[k], alpha))
            torch.testing.assert_close(result.radiance[k], torch.full_like(result.radiance[k], alpha * light))
            torch.testing.assert_close(result.depth[k], torch.full_like(result.depth[k], alpha * z))
        torch.testing.assert_close(result.alpha, torch.full_like(result.alpha, 0.5))

    def test_one_layer_is_a_normalised_splat(self):
        """Slowly, pixel by pixel, at full size alone."""
        result, s = self.model.result(self.samples, 1), self.samples
        alone = Layered(16)
        alone.load_state_dict(self.model.state_dict())
        with torch.no_grad():  # all of the result from the full size
            getattr(alone.kernel0, "2").bias[TAPS:] = torch.tensor([200.0, -100, -100])
            getattr(alone.kernel0, "2").weight[TAPS:] = 0
        found = alone.result(s, 1)
        kernels = torch.exp(found.logits[0].clamp(-12, 12)).detach().double().numpy()
        frames, height, width = SHAPE
        given = torch.cat([s.light, s.divisor, torch.ones_like(s.weight)[:, None], s.light * s.divisor], 1)
        own = np.zeros((frames * height * width, 10))
        np.add.at(own, s.pixel.numpy(), (s.weight[:, None] * given).double().numpy())
        own = own.reshape(frames, height, width, 10)
        sums, total = np.zeros_like(own), np.zeros((frames, height, width, 1))
        for f in range(frames):
            for y, x in np.ndindex(height, width):
                for tap in range(TAPS):
                    v, u = y + tap // 5 - 2, x + tap % 5 - 2
                    if 0 <= v < height and 0 <= u < width:
                        sums[f, v, u] += kernels[f, tap, y, x] * own[f, y, x]
                        total[f, v, u] += kernels[f, tap, y, x]
        around = np.maximum(sums[..., 3:6] / sums[..., 6:7], LEAST_ALBEDO)
        albedo = (own[..., 3:6] + OWN * around) / (own[..., 6:7] + OWN)
        light = np.minimum(sums[..., :3], sums[..., 7:] / around) / total
        expected = torch.from_numpy((light * albedo).transpose(0, 3, 1, 2)).float()
        torch.testing.assert_close(found.colour, expected, rtol=1e-4, atol=1e-5)
        self.assertGreater((result.colour - found.colour).abs().mean().item(), 1e-3)

    def test_light_that_albedo_does_not_explain_is_not_multiplied(self):
        """Pixels that see as much of a dark leaf with light behind it as of a white wall, everywhere alike."""
        pixel = torch.arange(PIXELS).repeat_interleave(2)
        light, divisor = torch.tensor([[10.0], [0.5]]).expand(2, 3), torch.tensor([[0.1], [1.0]]).expand(2, 3)
        s = Samples(torch.rand(2 * PIXELS, INPUTS), torch.full((2 * PIXELS,), 0.5), light.repeat(PIXELS, 1), torch.ones(2 * PIXELS), divisor.repeat(PIXELS, 1), pixel, SHAPE)
        torch.testing.assert_close(self.model(s, 1), torch.full((SHAPE[0], 3, *SHAPE[1:]), 0.75), rtol=1e-4, atol=1e-5)

    def test_the_order_of_samples_does_not_matter(self):
        order = torch.randperm(len(self.samples.pixel))
        mixed = Samples(*(x[order] for x in self.samples[:-1]), SHAPE)
        for k in LAYERS:
            torch.testing.assert_close(self.model(mixed, k), self.model(self.samples, k), rtol=1e-4, atol=1e-5)

    def test_frames_of_a_batch_do_not_mix(self):
        first = self.samples.pixel < PIXELS // 2
        one = Samples(*(x[first] for x in self.samples[:-1]), (1, *SHAPE[1:]))
        for k in LAYERS:
            torch.testing.assert_close(self.model(one, k), self.model(self.samples, k)[:1], rtol=1e-4, atol=1e-5)

    def test_nothing_gives_nothing(self):
        empty = Samples(torch.zeros(0, INPUTS), torch.zeros(0), torch.zeros(0, 3), torch.zeros(0), torch.zeros(0, 3), torch.zeros(0, dtype=torch.long), SHAPE)
        for k in LAYERS:
            result = self.model.result(empty, k)
            self.assertFalse(result.colour.any() or result.alpha.any())

    def test_work_is_counted_as_in_the_layers(self):
        for k in LAYERS:
            operations = [0]

            def count(layer, _, output):
                operations[0] += 2 * layer.weight.numel() * output.shape[0] * output[0, 0].numel()

            handles = [x.register_forward_hook(count) for name, x in self.model.named_modules() if isinstance(x, torch.nn.Conv2d)]
            one = Samples(*(x[self.samples.pixel < PIXELS // 2] for x in self.samples[:-1]), (1, *SHAPE[1:]))
            self.model(one, k)
            for handle in handles:
                handle.remove()
            rows = sum(x.numel() for name, x in self.model.named_parameters() if name.endswith("weight") and name.startswith(("reducer", "partition")))
            counted = 1e6 * operations[0] / (PIXELS // 2) / 1e9 + 2 * (rows * 3 - 2 * 16 * 32) / 1000 + 2 * k * 6 * TAPS * 21 / 16 / 1000
            self.assertAlmostEqual(gigaflops_per_megapixel(16, k, 3), counted, places=3)


class Inputs(unittest.TestCase):
    def channels(self):
        return golden_layers.random_frame(np.random.default_rng(3), 12, 9)

    def test_weights_are_what_is_seen_of_a_sample(self):
        counts = np.array([[0, 3], [1, 8]])
        alpha = np.array([0.25, 1 / 3, 0.5, 1.0, *(1 / (8 - k) for k in range(8))])
        np.testing.assert_allclose(samples.effective(alpha, counts.ravel()), [0.25] * 3 + [1] + [0.125] * 8, rtol=1e-12)

    def test_flattening_is_over(self):
        counts, channels = self.channels()
        deep = samples.measure(counts, channels)
        expected, k = np.zeros((9, 12)), 0
        for pixel in np.ndindex(9, 12):
            passed = 1.0
            for _ in range(counts[pixel]):
                expected[pixel] += passed * channels["G"][k]
                passed *= 1 - channels["A"][k]
                k += 1
        np.testing.assert_allclose(samples.flattened(deep, samples.light_of(deep.values))[1], expected, rtol=1e-4, atol=1e-6)

    def test_what_is_emitted_or_not_finite_has_no_say(self):
        counts, channels = self.channels()
        whole = samples.measure(counts, channels)
        channels["A"][3], channels["diffuse.G"][7], channels["Z"][9], channels["specular.B"][11] = 0, np.nan, np.inf, 2e15
        channels["albedo.R"][20] = np.nan
        deep = samples.measure(counts, channels)
        self.assertEqual(len(deep.weight), len(whole.weight) - 4)
        values = samples.inputs(deep.values, deep.weight, 0.5, samples.mean_depth(deep))
        self.assertTrue(np.isfinite(values).all())

    def test_what_each_input_holds(self):
        channels = {
            "A": 0.5, "Z": 4.0, "coc": -4.0, "lens.U": 0.25, "lens.V": 3.0, "albedo.R": 0.1, "albedo.G": 0.2, "albedo.B": 0.9, "N.X": -1.0,
            "N.Y": 0.25, "N.Z": 0.1, "diffuse.R": 0.1, "diffuse.G": 0.5, "diffuse.B": 0.3, "specular.R": -0.2, "specular.G": 0.0,
            "specular.B": 0.2, "variance.diffuse.R": 0.01, "variance.diffuse.G": 0.04, "variance.diffuse.B": 0.01, "samples": 3.0,
            "variance.specular.R": 100.0, "variance.specular.G": 100.0, "variance.specular.B": 100.0,
        }  # fmt: skip
        deep = samples.measure(np.ones((1, 1), int), {name: np.array([value], np.float32) for name, value in channels.items()})
        found = samples.inputs(deep.values, deep.weight, 0.5, 12.0)[0]
        expected = [
            *np.log1p([0.1, 0.5, 0.3]), 0, 0, np.log1p(0.2), 0.2, 0.4, 1, -1, 0.5, 0.2, 0.25, -0.5, 0.25, 1, 0.5,
            np.log1p(0.5 * np.sqrt(0.02) / 0.31), np.log1p(8), 0.25,
        ]  # fmt: skip
        np.testing.assert_allclose(found, expected, rtol=1e-5)

    def test_a_camera_sample_has_the_deviation_of_its_pixels_mean(self):
        random = np.random.default_rng(4)
        counts, light = np.array([[0, 4], [1, 3]]), random.random((8, 6))
        alpha = np.array([1 / (4 - k) for k in range(4)] + [0.25, 0.25, 1 / 3, 0.5])
        channels = {"A": alpha, "Z": np.full(8, 2.0)}
        for k, name in enumerate(("diffuse.R", "diffuse.G", "diffuse.B", "specular.R", "specular.G", "specular.B")):
            channels[name] = light[:, k] * alpha
        noise = samples.measure(counts, channels, 4).values[:, samples.WHERE["noise"]]
        for rows in (slice(0, 4), slice(5, 8)):
            own = light[rows].reshape(-1, 2, 3)
            expected = np.sqrt(own.var(0, ddof=1).mean(1) / len(own))
            np.testing.assert_allclose(noise[rows], np.tile(expected, (len(own), 1)), rtol=1e-5)
        self.assertFalse(noise[4].any())
        for bins in ({"samples": np.ones(8)}, {f"variance.{c}": np.zeros(8) for c in "RGB"}):
            self.assertFalse(samples.measure(counts, {**channels, **bins}, 4).values[:, samples.WHERE["noise"]].any())
        self.assertFalse(samples.measure(counts, channels).values[:, samples.WHERE["noise"]].any())

    def test_lights_apart_are_all_of_the_light(self):
        counts, channels = self.channels()
        deep = samples.measure(counts, channels)
        diffuse, specular = samples.lights_apart(deep)
        light = [x.divisor * samples.light_of(x.values) for x in (diffuse, specular)]
        np.testing.assert_allclose(sum(light), samples.light_of(deep.values), rtol=1e-5)
        np.testing.assert_allclose(diffuse.divisor, deep.values[:, samples.WHERE["albedo"]].clip(0, 1) + 0.1, rtol=1e-6)
        self.assertFalse(diffuse.values[:, 3:6].any() or specular.values[:, :3].any())
        noise = deep.values[:, samples.WHERE["noise"]]
        np.testing.assert_allclose(diffuse.values[:, samples.WHERE["noise"]] * diffuse.divisor.mean(1, keepdims=True), noise * [1, 0], rtol=1e-5)
        np.testing.assert_array_equal(specular.values[:, samples.WHERE["noise"]], noise * [0, 1])
        self.assertEqual(len(samples.lights_apart(diffuse)), 1)

    def test_what_is_missing(self):
        channels = {"A": 1.0, "Z": 2.0, "R": 0.1, "G": 0.2, "B": 0.3, "variance.R": 0.01, "variance.G": 0.01, "variance.B": 0.01}
        deep = samples.measure(np.ones((1, 1), int), {name: np.array([value], np.float32) for name, value in channels.items()}, 7)
        found = samples.inputs(deep.values, deep.weight, 1.0, 2.0)[0]
        expected = [0, 0, 0, *np.log1p([0.1, 0.2, 0.3]), 0.5, 0.5, 0.5, 0, 0, 0, 0.5, 0, 0, 0, 1, 0, np.log1p(0.1 / 0.21), 3 / 8]
        np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-7)


class Files(unittest.TestCase):
    def test_golden(self):
        FOLDER.mkdir(parents=True, exist_ok=True)
        network, out = FOLDER / "layers.safetensors", FOLDER / "layers_golden.safetensors"
        network.unlink(missing_ok=True)
        golden_layers.main([str(network), str(out)])
        tensors, _ = weights.read_tensors(out)
        self.assertTrue(all(np.isfinite(x).all() for x in tensors.values()))
        self.assertTrue({0, 1, golden_layers.MOST} <= set(tensors["counts"].ravel()))
        for k in LAYERS:
            self.assertEqual(tensors[f"radiance{k}"].shape, (k, 3, 19, 26))
            self.assertGreater(tensors[f"colour{k}"].std(), 0.05)
        _, metadata = weights.read_tensors(network)
        fixed = {"format": "fathom-layers", "version": "1", "width": "16", "embedding": "32", "inputs": "20"}
        self.assertLessEqual(fixed.items(), metadata.items())
        with self.assertRaisesRegex(ValueError, "fathom-compositional"):
            weights.load_model(network)


if __name__ == "__main__":
    unittest.main()
