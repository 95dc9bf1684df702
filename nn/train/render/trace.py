"""A path tracer that splits light by the lobe of the first surface and keeps that surface's features.

The first surface is the first one that a camera path does not pass (masks and thin glass are passed by chance).
The diffuse component is light scattered there by diffuse lobes; the specular one is everything else, emission too.
Emitters are sampled directly and met by chance, weighted by the power heuristic.
"""
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi


@dataclass
class Path:
    """What one camera path per lane found; the features are 0 where nothing was hit."""
    diffuse: mi.Color3f
    specular: mi.Color3f
    hit: mi.Bool
    position: mi.Point3f
    normal: mi.Normal3f
    albedo: mi.Color3f


def finite(v):
    return dr.all(dr.isfinite(v))


def power(a, b):
    """The power heuristic's weight of a sample of density a."""
    w = a * a / (a * a + b * b)
    return dr.select(dr.isfinite(w), w, 0)


@dr.syntax
def trace(scene, sampler, camera_ray, max_depth, background):
    """Path per lane. `background` weighs the environment where it is seen directly."""
    ray = mi.Ray3f(camera_ray)
    context, diffuse_context = mi.BSDFContext(), mi.BSDFContext()
    diffuse_context.type_mask = mi.BSDFFlags.Diffuse
    diffuse, specular = mi.Color3f(0), mi.Color3f(0)
    to_diffuse, to_specular = mi.Color3f(0), mi.Color3f(1)  # throughput of either component
    hit = mi.Bool(False)
    position, normal, albedo = mi.Point3f(0), mi.Normal3f(0), mi.Color3f(0)
    depth, steps, eta = mi.UInt32(0), mi.UInt32(0), mi.Float(1)
    last, last_pdf = dr.zeros(mi.Interaction3f), mi.Float(1)
    unsampled = mi.Bool(True)  # emitter sampling cannot have found what this ray meets
    active = mi.Bool(True)
    while active:
        si = scene.ray_intersect(ray, mi.RayFlags.All, depth == 0)
        ds = mi.DirectionSample3f(scene, si, last)
        w = dr.select(unsampled, 1, power(last_pdf, scene.pdf_emitter_direction(last, ds, ~unsampled)))
        light = ds.emitter.eval(si) * w * dr.select(hit | si.is_valid(), 1, background)
        diffuse += to_diffuse * light
        specular += to_specular * light
        active_next = si.is_valid() & (depth < max_depth)

        bsdf = si.bsdf(ray)
        bs, weight = bsdf.sample(context, si, sampler.next_1d(active_next), sampler.next_2d(active_next), active_next)
        passed = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Null)
        delta = mi.has_flag(bs.sampled_type, mi.BSDFFlags.Delta)
        solid = active_next & ~passed & finite(si.wi)
        first = solid & ~hit
        n = mi.Normal3f(si.sh_frame.n)
        position = dr.select(first, si.p, position)
        normal = dr.select(first, dr.select(dr.dot(n, ray.d) > 0, -n, n), normal)
        a = dr.clip(bsdf.eval_diffuse_reflectance(si, first), 0, 1)
        albedo = dr.select(first & finite(a), a, albedo)

        # Emitter sampling; the lobes carry the opacity, and only that share of the paths comes here.
        sampled = solid & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
        through = bsdf.eval_null_transmission(si, active_next)  # not dr.mean: its factor compiles anew for every launch size
        opacity = dr.maximum(1 - (through[0] + through[1] + through[2]) / 3, 1e-4)
        es, emitted = scene.sample_emitter_direction(si, sampler.next_2d(active_next), True, sampled)
        sampled &= es.pdf > 0
        wo = si.to_local(es.d)
        f, f_pdf = bsdf.eval_pdf(context, si, wo, sampled)
        f_diffuse = dr.minimum(bsdf.eval(diffuse_context, si, wo, sampled & first), f)
        emitted *= dr.select(sampled, dr.select(es.delta, 1, power(es.pdf, f_pdf)) / opacity, 0)
        diffuse += dr.select(first, f_diffuse, to_diffuse * f) * emitted
        specular += dr.select(first, f - f_diffuse, to_specular * f) * emitted

        # The next ray
        share = bsdf.eval(diffuse_context, si, bs.wo, first & ~delta) / bs.pdf
        share = dr.minimum(dr.select(first & ~delta & (bs.pdf > 0), share, 0), weight)
        to_diffuse = dr.select(first, share, to_diffuse * weight)
        to_specular = dr.select(first, weight - share, to_specular * weight)
        eta *= bs.eta
        hit |= first
        last, last_pdf = dr.select(passed, last, mi.Interaction3f(si)), dr.select(passed, last_pdf, bs.pdf)
        unsampled = delta  # passing counts too: what is behind a mask is hidden from emitter sampling
        ray = si.spawn_ray(si.to_world(bs.wo))
        depth += dr.select(passed, 0, 1)
        steps += 1
        top = dr.maximum(dr.max(to_diffuse), dr.max(to_specular))
        survive = dr.select(depth >= 3, dr.minimum(top * eta * eta, 0.95), 1)
        alive = sampler.next_1d(active_next) < survive
        to_diffuse /= survive
        to_specular /= survive
        active = active_next & alive & (top > 0) & (steps < 64) & finite(ray.d) & finite(ray.o)
    return Path(diffuse, specular, hit, position, normal, albedo)
