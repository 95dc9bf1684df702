"""Scenes of random objects: open ground, studios, rooms, clutter. z is up; sizes are in units of a large object."""
from dataclasses import dataclass, field

import mitsuba as mi
import numpy as np

import lights
import materials
import meshes


@dataclass
class Stage:
    """A scene under construction, and where a camera may stand and look."""
    parts: dict = field(default_factory=dict)
    targets: list = field(default_factory=list)
    radius: float = 4.0  # of the content
    room: tuple = None  # half width, half depth, height: the camera stays inside

    def put(self, mesh, bsdf):
        self.add(meshes.shape(mesh, bsdf=mi.load_dict(bsdf)))

    def add(self, part):
        self.parts[f'part{len(self.parts)}'] = part

    def camera(self, rng):
        """(origin, target, up, fov) of a random view."""
        target = self.targets[rng.integers(len(self.targets))] + rng.normal(size=3) * 0.2
        fov = rng.uniform(25, 80)
        if self.room:
            x, y, z = self.room
            spots = rng.uniform([-0.9 * x, -0.9 * y, 0.15 * z], [0.9 * x, 0.9 * y, 0.85 * z], (rng.integers(2, 6), 3))
            origin = spots[np.argmax(np.linalg.norm(spots - target, axis=1))]
        else:
            a, e = rng.uniform(0, 2 * np.pi), np.radians(np.exp(rng.uniform(np.log(3), np.log(60))))
            distance = self.radius * np.exp(rng.uniform(np.log(0.6), np.log(2))) / np.tan(np.radians(fov / 2)) ** 0.5
            origin = target + distance * np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])
            origin[2] = max(origin[2], 0.2)
        return origin, target, np.array([rng.normal() * 0.05, rng.normal() * 0.05, 1.0]), fov


def shared_materials(rng, count):
    """A scene has some materials; objects share them."""
    return [materials.anything(rng) for _ in range(count)]


def scatter(rng, stage, count, spread, lift=0.0):
    """Objects on the ground, some on top of one another; lift: how far they may float."""
    palette = shared_materials(rng, int(rng.integers(4, 12)))
    places = np.empty((0, 2))
    for _ in range(count):
        tries = rng.uniform(-1, 1, (6, 2)) * spread
        gap = np.min(np.linalg.norm(tries[:, None] - places[None], axis=2), axis=1) if len(places) else np.zeros(6)
        at = tries[np.argmax(gap)]
        places = np.vstack([places, at])
        size = np.exp(rng.uniform(np.log(0.25), np.log(1.8))) * np.exp(rng.normal(size=3) * 0.25 * (rng.random() < 0.5))
        mesh = meshes.anything(rng).moved(size, meshes.rotation(rng, tilt=rng.choice([0, 0, 0.4, np.pi]))).on_ground()
        height = lift * rng.random() ** 2 + (rng.uniform(0.3, 1.2) if rng.random() < 0.15 else 0)
        mesh = mesh.moved(to=(*at, height))
        stage.put(mesh, palette[rng.integers(len(palette))])
        stage.targets.append(mesh.vertices.mean(0))


def ground(rng, stage, size):
    if rng.random() < 0.25:
        mesh = meshes.terrain(rng, 2 * size, rng.uniform(0.05, 0.4))
        mesh = mesh.moved(to=(0, 0, -mesh.vertices[:, 2].max()))
    else:
        mesh = meshes.plane().moved(2 * size)
    stage.put(mesh, materials.surface(rng, textured=0.8))


def lamps(rng, stage, count, extent, low, high):
    """Area lights and some spots in a shell around the content."""
    for _ in range(count):
        position = np.array([*(rng.uniform(-1, 1, 2) * extent), rng.uniform(low, high)])
        target = stage.targets[rng.integers(len(stage.targets))]
        power = np.exp(rng.normal() * 0.8) * np.sum((position - target) ** 2)
        if rng.random() < 0.12:
            stage.add(lights.spot(rng, position, target, power))
        else:
            stage.add(lights.lamp(rng, position, target, lights.lamp_size(rng, high / 2), power))


def outdoors(rng, hdris):
    """Ground, objects, an environment; sometimes a field of grass and lamps as well."""
    spread = rng.uniform(2, 5)
    stage = Stage(radius=spread)
    scatter(rng, stage, int(rng.integers(10, 50)), spread)
    ground(rng, stage, rng.uniform(1.2, 5) * spread)
    if rng.random() < 0.3:
        grass = materials.two_sided(materials.matte(rng, textured=0))
        for _ in range(int(rng.integers(3, 12))):
            stage.put(meshes.tuft(rng, int(rng.integers(200, 900))).moved(rng.uniform(0.5, 2), to=(*rng.uniform(-spread, spread, 2), 0)), grass)
    stage.add(lights.environment(rng, hdris))
    if rng.random() < 0.3:
        lamps(rng, stage, int(rng.integers(1, 4)), spread, 1, 5)
    return stage


def studio(rng, hdris):
    """A product shot: ground and a wall, area lights, dark surroundings."""
    spread = rng.uniform(1.5, 4)
    stage = Stage(radius=spread)
    scatter(rng, stage, int(rng.integers(10, 40)), spread, lift=rng.choice([0, 0, 1.5]))
    ground(rng, stage, 3 * spread)
    if rng.random() < 0.6:
        for side in range(int(rng.integers(1, 3))):
            turn = np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]]) if side else np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
            wall = meshes.plane().moved(6 * spread, turn)
            stage.put(wall.moved(to=(0, 2 * spread, 0) if not side else (2 * spread, 0, 0)), materials.surface(rng))
    lamps(rng, stage, int(rng.integers(1, 7)), 1.8 * spread, 2.0, 7)
    if rng.random() < 0.7:
        stage.add(lights.fill(rng))
    return stage


def wall_parts(half, height, window):
    """A wall around a window (relative bounds along and up, or none): (middle, length, middle, height) of each part."""
    if window is None:
        return [(0, 2 * half, height / 2, height)]
    u0, u1, v0, v1 = (2 * window[0] - 1) * half, (2 * window[1] - 1) * half, window[2] * height, window[3] * height
    parts = [(-half, u0, 0, height), (u1, half, 0, height), (u0, u1, 0, v0), (u0, u1, v1, height)]
    return [((a + b) / 2, b - a, (c + d) / 2, d - c) for a, b, c, d in parts]


def room(rng, hdris):
    """A closed box with furniture-like objects, lit through windows, by lamps, or by lamps that shine at the ceiling."""
    x, y, z = rng.uniform(2, 5), rng.uniform(2, 5), rng.uniform(2.2, 4)
    stage = Stage(room=(x, y, z))
    scatter(rng, stage, int(rng.integers(10, 40)), 0.85 * min(x, y))
    stage.put(meshes.plane().moved((2 * x, 2 * y, 1)), materials.surface(rng, textured=0.8))
    wall = materials.paint(rng)
    stage.put(meshes.plane().moved((2 * x, 2 * y, 1), np.diag([1, -1, -1]), (0, 0, z)), materials.paint(rng))
    windows = int(rng.choice([0, 1, 1, 2]))
    for side in range(4):
        half, out = (x, y) if side < 2 else (y, x)
        sign = 1 if side % 2 else -1
        window = sorted(rng.uniform(0.1, 0.9, 2)) + sorted(rng.uniform(0.2, 0.95, 2)) if side < windows else None
        paint = wall if rng.random() < 0.7 else materials.two_sided(materials.matte(rng, 0.7))
        for u, du, v, dv in wall_parts(half, z, window):
            size, to = ((du, 0.1, dv), (u, sign * out, v)) if side < 2 else ((0.1, du, dv), (sign * out, u, v))
            stage.put(meshes.box().moved(size, to=to), paint)
    if windows:
        stage.add(lights.environment(rng, hdris))
    if not windows or rng.random() < 0.4:
        lamps(rng, stage, int(rng.integers(1, 5)), 0.8 * min(x, y), 0.5 * z, 0.95 * z)
    for _ in range(int(rng.integers(0, 3))):  # uplights: nearly all light is indirect
        at = np.array([*(rng.uniform(-0.8, 0.8, 2) * (x, y)), 0.5 * z])
        stage.add(lights.lamp(rng, at, at + [0, 0, 1], rng.uniform(0.1, 0.5), 6 * np.exp(rng.normal())))
    return stage


def clutter(rng, hdris):
    """Objects at all depths in the air: edges, defocus, occlusion."""
    spread = rng.uniform(2, 4)
    stage = Stage(radius=spread)
    scatter(rng, stage, int(rng.integers(25, 60)), spread, lift=2 * spread)
    if rng.random() < 0.7:
        ground(rng, stage, 4 * spread)
    if rng.random() < 0.6:
        stage.add(lights.environment(rng, hdris))
    else:
        lamps(rng, stage, int(rng.integers(2, 6)), 2 * spread, 2, 10)
        stage.add(lights.fill(rng))
    return stage


def veil(rng, hdris):
    """Hair, leaves, bars or wires close to the camera, and a scene far behind them."""
    stage = (outdoors, studio, clutter)[rng.integers(3)](rng, hdris)
    middle = np.mean(stage.targets, axis=0)
    palette = shared_materials(rng, int(rng.integers(2, 5)))
    kinds = [meshes.tuft, meshes.tuft, meshes.cards, meshes.fence, meshes.wire]
    ring = stage.radius * rng.uniform(2.0, 3.0)  # cameras stand outside of it, objects inside
    stage.radius = 0.5 * ring
    stage.targets = [middle + rng.normal(size=3) * 0.3 * ring]
    for _ in range(int(rng.integers(40, 90))):
        a, size = rng.uniform(0, 2 * np.pi), np.exp(rng.uniform(np.log(0.3), np.log(1.2)))
        at = middle + ring * rng.uniform(0.8, 1.1) * np.array([np.cos(a), np.sin(a), 0])
        at[2] = rng.uniform(0.1, 0.6) * ring
        mesh = kinds[rng.integers(len(kinds))](rng).moved(size, meshes.rotation(rng), at)
        stage.put(mesh, palette[rng.integers(len(palette))])
    low, high = 1.2 * ring, 1.7 * ring

    def camera(rng):
        target = middle + rng.normal(size=3) * 0.15 * ring
        a, distance = rng.uniform(0, 2 * np.pi), rng.uniform(low, high)
        origin = middle + np.array([distance * np.cos(a), distance * np.sin(a), rng.uniform(0.15, 0.6) * ring])
        return origin, target, np.array([rng.normal() * 0.05, rng.normal() * 0.05, 1.0]), rng.uniform(25, 55)

    stage.camera = camera
    return stage


def pelt(rng, hdris):
    """A few furry things, with a few others between them."""
    spread = rng.uniform(1.0, 2.5)
    stage = Stage(radius=0.8 * spread)
    scatter(rng, stage, int(rng.integers(2, 10)), spread)
    stage.targets = []
    bodies = (lambda r: meshes.sphere(), meshes.superquadric, meshes.blob, meshes.lathe, meshes.torus)
    for _ in range(int(rng.integers(1, 5))):
        body = bodies[rng.integers(len(bodies))](rng)
        skin = materials.two_sided(materials.matte(rng, textured=0.3))
        hair = materials.two_sided(materials.matte(rng, textured=0.5) if rng.random() < 0.6 else materials.plastic(rng, textured=0.5))
        place = dict(scale=rng.uniform(0.7, 2), rotation=meshes.rotation(rng), to=(*rng.uniform(-0.6, 0.6, 2) * spread, rng.uniform(0.3, 1.2)))
        stage.put(body.moved(0.98).moved(**place), skin)
        stage.put(meshes.pelt(rng, body).moved(**place), hair)
        stage.targets.append(np.array(place['to']))
    ground(rng, stage, 3 * spread)
    if rng.random() < 0.5:
        stage.add(lights.environment(rng, hdris))
    else:
        lamps(rng, stage, int(rng.integers(1, 4)), 1.5 * spread, 2, 6)
        stage.add(lights.fill(rng))
    return stage


KINDS = {f.__name__: f for f in (outdoors, studio, room, clutter, veil, pelt)}


def build(rng, hdris, kind=''):
    """(scene, camera proposals of a generator, name of its kind), of a kind of KINDS; drawn without."""
    kind = KINDS[kind] if kind else (outdoors, studio, room, clutter)[rng.choice(4, p=[0.24, 0.28, 0.32, 0.16])]
    stage = kind(rng, hdris)
    return mi.load_dict({'type': 'scene', **stage.parts}), stage.camera, kind.__name__
