#!/usr/bin/env python3
"""Laws of the mixing network and of the rule that it corrects."""

import sys
import unittest
from pathlib import Path

try:
    import torch

    sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "nn" / "train"))
    import mix_model
    import mix_planes
except ImportError as error:
    print(f"skipped: laws of the mix, because of {error}")
    sys.exit(77)

torch.set_num_threads(1)


def mix_parts(count, height=8, width=12):
    """What `mixed` takes: a frame whose candidates are near the truth, which is 1."""
    shapes = {"x": (1, 3), "noise": (1, 3), "samples": (1, 1)}
    shapes.update({name: (1, count, 3) for name in ("y", "error", "variance", "covariance")}, gate=(1, count, 1))
    parts = {name: torch.rand(*shape, height, width) for name, shape in shapes.items()}
    parts["samples"] = torch.full_like(parts["samples"], 8)
    parts["covariance"] = 0.1 * torch.minimum(parts["error"], parts["variance"])
    return parts


class Mixing(unittest.TestCase):
    def setUp(self):
        torch.manual_seed(1)
        self.model = mix_model.Mix()
        self.own, self.shared = torch.randn(1, 3, mix_planes.OWN, 8, 12), torch.randn(1, mix_planes.SHARED, 8, 12)

    def test_knows_nothing_at_first(self):
        weight, share = self.model(self.own, self.shared)
        self.assertEqual(weight.abs().max().item(), 0)
        self.assertEqual(share.abs().max().item(), 0)

    def test_order_of_candidates_does_not_matter(self):
        for layer in (self.model.weight, self.model.share):
            torch.nn.init.normal_(layer.weight)
        weight, share = self.model(self.own, self.shared)
        turned, same = self.model(self.own[:, [2, 0, 1]], self.shared)
        torch.testing.assert_close(turned, weight[:, [2, 0, 1]], rtol=1e-4, atol=1e-5)
        torch.testing.assert_close(same, share, rtol=1e-4, atol=1e-5)

    def test_one_candidate_is_mixed_by_equation_9(self):
        p = mix_parts(1)
        zeros = torch.zeros_like(p["gate"])
        result, _ = mix_model.mixed(zeros, zeros[:, 0], *p.values())
        e, v, c = (p[name][:, 0] for name in ("error", "variance", "covariance"))
        s = (8 + 11) / (8 - 1) * torch.maximum(v, p["noise"])
        share = torch.minimum(((s - c) / (e + s - 2 * c)).clamp(0, 1), 1 - p["gate"][:, 0] / ((8 + 11) / (8 - 1)))
        torch.testing.assert_close(result, p["x"] + share * (p["y"][:, 0] - p["x"]))

    def test_two_of_the_same_are_one(self):
        one = mix_parts(1)
        two = {name: torch.cat([x, x], 1) if x.dim() == 5 else x for name, x in one.items()}
        zeros = torch.zeros_like(one["gate"])
        expected, _ = mix_model.mixed(zeros, zeros[:, 0], *one.values())
        result, weights = mix_model.mixed(torch.zeros_like(two["gate"]), zeros[:, 0], *two.values())
        torch.testing.assert_close(weights, torch.full_like(weights, 0.5))
        torch.testing.assert_close(result, expected, rtol=1e-4, atol=1e-5)

    def test_whatever_is_said_the_gate_bounds_it(self):
        p = mix_parts(2)
        p["gate"] = torch.ones_like(p["gate"])
        p["samples"] = torch.full_like(p["samples"], 1e9)
        share = torch.full_like(p["gate"][:, 0], 50.0)
        result, _ = mix_model.mixed(torch.randn_like(p["gate"]), share, *p.values())
        torch.testing.assert_close(result, p["x"], rtol=1e-4, atol=1e-5)

    def test_is_small(self):
        self.assertLess(mix_model.gigaflops_per_megapixel(), 16)
        self.assertLess(sum(x.numel() for x in self.model.parameters()), 40000)


if __name__ == "__main__":
    unittest.main()
