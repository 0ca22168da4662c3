"""Light of the LEDs tile by tile: rays, and start values of hits, are interpolated from the tile's corners.

What a ray meets is computed as in `wall_light`; only the search for it starts nearer. Where the wall is not
calm, a pixel is left to `wall_light` itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.arrays import Float, Float32
from pipeline.simulator.calm import hit_near
from pipeline.simulator.kernel import in_bands, kernel, summing_kernel
from pipeline.simulator.raycast import first_hit, normal_at
from pipeline.simulator.surface import Texture, albedo_at, sheen_at
from pipeline.simulator.view import REFERENCE_MM, View, Work, new_work, to_wall
from pipeline.simulator.wall_light import Lamps, glow_at, least_ahead, light_of_ray

# Side of a tile, px; the ray table's spacing, so that its nodes are the tiles' corners.
TILE_PX = 8
# Precision of a hit at a corner, which only begins the search for others, and of a pixel's, mm: a hundredth
# of what a pixel spans in a 2 inch bore.
_CLOSE_START_MM, _CLOSE_MM = 0.05, 1e-3
# A lobe cos^2h is left out below e^-9 of its peak. A lamp lies at most half a bore's radius off the camera:
# the cosine towards it is at most 1.28 times that towards the camera, and cos² halfway below 1.3 facing².
_LOBE_ENDS, _LAMP_FACING = 9.0, 1.3
# How much the cosine to the optical axis may differ within a tile: 11 px at 200 px a radian.
_AHEAD_ROOM = 0.06


class Corners(NamedTuple):
    """Tables at the nodes of the ray table at one moment.

    Attributes
    ----------
    ray : (rows, columns, 6)
        Origin and direction in W; NaN where no ray maps.
    ahead, way, distance_mm : (rows, columns)
        Cosine to the optical axis; way and distance of the hit, NaN where there is none.
    """

    ray: Float
    ahead: Float
    way: Float
    distance_mm: Float


class Room(NamedTuple):
    """Work arrays: a ray's; a row's ray nodes (4, 6); LEDs in W's axes (3, L); see `light_of_ray`."""

    work: Work
    nodes: Float
    lamp_w: Float
    lit: Float
    total: Float


def add_wall(view: View, lamps: Lamps, colour: Float, samples: int, image: Float32) -> None:
    """Add the light of the wall under the lamps to an image (H, W, 3)."""
    times, leds = view.pose.shape[1], lamps.place.shape[1]
    weights = _lagrange(samples)
    share = colour / (samples * samples * times)
    for k in range(times):
        corners = _corners(view, k, least_ahead(lamps))

        def band(first: int, last: int, k: int = k, corners: Corners = corners) -> None:
            room = Room(new_work(), np.empty((4, 6)), np.empty((3, leds)), np.empty((3, leds)), np.empty(3))
            _add_tiles(view, corners, lamps, share, weights, samples, k, first, last, room, image)

        in_bands(band, len(image))


def _lagrange(samples: int) -> Float:
    """Return the weights (offsets, 4) of Lagrange's cubic at the parts of a tile's pixels."""
    w = ((np.arange(TILE_PX * samples) + 0.5) / samples - 0.5) / TILE_PX
    weights = (
        -w * (w - 1) * (w - 2) / 6, (w + 1) * (w - 1) * (w - 2) / 2,
        -(w + 1) * w * (w - 2) / 2, (w + 1) * w * (w - 1) / 6,
    )  # fmt: skip
    return np.ascontiguousarray(np.stack(weights, -1))


def _corners(view: View, k: int, least: float) -> Corners:
    """Return rays, and hits where light may come from, at the nodes of the ray table at moment k."""
    shape = view.rays.node.shape[:2]
    corners = Corners(np.empty((*shape, 6)), np.empty(shape), np.full(shape, np.nan), np.full(shape, np.nan))

    def band(first: int, last: int) -> None:
        _write_corners(view, k, least - _AHEAD_ROOM, new_work(), first, last, corners)

    in_bands(band, shape[0])
    return corners


@kernel
def _write_corners(
    view: View, k: int, least: float, work: Work, first: int, last: int, corners: Corners
) -> None:
    c_ray, w_ray, hit = work.c_ray, work.w_ray, work.hit
    for i in range(first, last):
        row = max(int(view.rays.first + i * view.rays.step), 0)
        for j in range(corners.way.shape[1]):
            for c in range(6):
                c_ray[c] = view.rays.node[i, j, c]
            to_wall(view, row, k, c_ray, w_ray)
            for c in range(6):
                corners.ray[i, j, c] = w_ray[c]
            corners.ahead[i, j] = c_ray[5]
            if not (c_ray[5] > least):
                continue
            if first_hit(view.surface, w_ray, view.distance_mm, _CLOSE_START_MM, work.o, work.R, hit):
                corners.way[i, j], corners.distance_mm[i, j] = hit[0], hit[1]


@kernel
def _add_tiles(
    view: View, corners: Corners, lamps: Lamps, share: Float, weights: Float, samples: int, k: int,
    v_from: int, v_to: int, room: Room, image: Float32,
) -> None:  # fmt: skip
    least = least_ahead(lamps)
    margin = int(-view.rays.first) // TILE_PX
    for v in range(v_from, v_to, TILE_PX):
        T = view.pose[min(v + TILE_PX // 2, view.pose.shape[0] - 1), k]
        for n in range(lamps.place.shape[1]):
            x, y, z = lamps.place[0, n], lamps.place[1, n], lamps.place[2, n]
            for a in range(3):
                room.lamp_w[a, n] = T[a, 0] * x + T[a, 1] * y + T[a, 2] * z
        for u in range(0, image.shape[1], TILE_PX):
            i, j = v // TILE_PX + margin, u // TILE_PX + margin
            ahead = corners.ahead
            most = max(max(ahead[i, j], ahead[i, j + 1]), max(ahead[i + 1, j], ahead[i + 1, j + 1]))
            if most < least - _AHEAD_ROOM:
                continue
            for n in range(samples * samples):
                _add_tile(view, corners, lamps, share, weights, samples, n, k, T, v, u, v_to, room, image)


@kernel
def _add_tile(
    view: View, corners: Corners, lamps: Lamps, share: Float, weights: Float, samples: int, n: int, k: int,
    T: Float, v_from: int, u_from: int, v_to: int, room: Room, image: Float32,
) -> None:  # fmt: skip
    """Add the light of part ``n`` of every pixel of a tile."""
    margin = int(-view.rays.first) // TILE_PX
    i, j = v_from // TILE_PX + margin, u_from // TILE_PX + margin
    way, distance = corners.way, corners.distance_mm
    known = way[i, j] + way[i, j + 1] + way[i + 1, j] + way[i + 1, j + 1]
    usable = view.rays.locking == 0.0 and known == known
    first = 3 if view.rays.central else 0
    for v in range(v_from, min(v_from + TILE_PX, v_to)):
        y = (v - v_from) * samples + n // samples
        h = (y + 0.5) / samples / TILE_PX - 0.5 / TILE_PX
        _write_row(corners.ray, i, j, weights, y, first, room.nodes)
        for c in range(first):
            room.work.w_ray[c] = view.pose[min(v, view.pose.shape[0] - 1), k, c, 3]
        way_left = (1 - h) * way[i, j] + h * way[i + 1, j]
        way_right = (1 - h) * way[i, j + 1] + h * way[i + 1, j + 1]
        s_left = (1 - h) * distance[i, j] + h * distance[i + 1, j]
        s_right = (1 - h) * distance[i, j + 1] + h * distance[i + 1, j + 1]
        for u in range(u_from, min(u_from + TILE_PX, image.shape[1])):
            x = (u - u_from) * samples + n % samples
            w = (x + 0.5) / samples / TILE_PX - 0.5 / TILE_PX
            if usable:
                _write_ray(room.nodes, weights, x, first, room.work.w_ray)
                start, s = (1 - w) * way_left + w * way_right, (1 - w) * s_left + w * s_right
                if _add_pixel(view, lamps, share, samples, T, start, s, v, u, room, image):
                    continue
            for c in range(3):
                room.total[c] = 0.0
            light_of_ray(view, lamps, v, u, n, k, samples, room.work, room.lit, room.total)
            for c in range(3):
                image[v, u, c] += share[c] * room.total[c]


@kernel
def _write_row(ray: Float, i: int, j: int, weights: Float, y: int, first: int, nodes: Float) -> None:
    """Write the ray nodes (4, 6) left and right of a tile, interpolated to one of its rows."""
    for m in range(4):
        for c in range(first, 6):
            nodes[m, c] = (
                weights[y, 0] * ray[i - 1, j - 1 + m, c] + weights[y, 1] * ray[i, j - 1 + m, c]
                + weights[y, 2] * ray[i + 1, j - 1 + m, c] + weights[y, 3] * ray[i + 2, j - 1 + m, c]
            )  # fmt: skip


@kernel
def _write_ray(nodes: Float, weights: Float, x: int, first: int, ray: Float) -> None:
    """Write a ray in W, of unit length, from the nodes of its row."""
    w0, w1, w2, w3 = weights[x, 0], weights[x, 1], weights[x, 2], weights[x, 3]
    for c in range(first, 6):
        ray[c] = w0 * nodes[0, c] + w1 * nodes[1, c] + w2 * nodes[2, c] + w3 * nodes[3, c]
    size = 1.0 / np.sqrt(ray[3] * ray[3] + ray[4] * ray[4] + ray[5] * ray[5])
    for c in range(3, 6):
        ray[c] *= size


@kernel
def _add_pixel(
    view: View, lamps: Lamps, share: Float, samples: int, T: Float, start: float, s: float, v: int, u: int,
    room: Room, image: Float32,
) -> bool:  # fmt: skip
    """Add the light at the ray in ``work``; return whether its hit is reliable."""
    ray, hit, normal, albedo = room.work.w_ray, room.work.hit, room.work.normal, room.work.albedo
    if not (ray[3] * T[0, 2] + ray[4] * T[1, 2] + ray[5] * T[2, 2] > least_ahead(lamps)):
        return True
    if not hit_near(view.surface, view.clear_mm, ray, start, s, _CLOSE_MM, room.work.o, room.work.R, hit):
        return False
    normal_at(view.surface, hit, room.work.R, normal)
    facing = -(ray[3] * normal[0] + ray[4] * normal[1] + ray[5] * normal[2])
    if facing <= 0.0:
        return True
    light = lamps.ambient
    if lamps.place.shape[1] > 0:
        light += _light_at(lamps, room.lamp_w, view.texture, T, ray, hit[0], normal, facing)
    foot = hit[0] / (view.px_per_rad * samples * max(facing, 0.05))
    albedo_at(view.texture, hit[1], hit[2], foot, albedo)
    for c in range(3):
        image[v, u, c] += share[c] * (light + glow_at(lamps, hit[1], c)) * albedo[c]
    return True


@kernel
def _light_at(
    lamps: Lamps, lamp_w: Float, texture: Texture, T: Float, ray: Float, way: float, normal: Float,
    facing: float,
) -> float:  # fmt: skip
    """Return the light of all lamps at a hit in plain view of them all (see `hit_near`)."""
    px, py = ray[0] + way * ray[3] - T[0, 3], ray[1] + way * ray[4] - T[1, 3]
    pz = ray[2] + way * ray[5] - T[2, 3]
    if lamps.lobe != 1.0:
        return float(_narrow_light(lamps, lamp_w, texture, T, px, py, pz, ray, normal, facing))
    if texture.gloss == 0.0 or texture.half_lobe * (1.0 - _LAMP_FACING * facing * facing) > _LOBE_ENDS:
        return float((1.0 - texture.gloss) * _dull_light(lamps, lamp_w, T, px, py, pz, normal))
    return float(_glossy_light(lamps, lamp_w, texture, T, px, py, pz, ray, normal, facing))


@summing_kernel
def _dull_light(
    lamps: Lamps, lamp_w: Float, T: Float, px: float, py: float, pz: float, normal: Float
) -> float:
    """Return the light of bare LEDs on a matt wall."""
    ahead, even = px * T[0, 2] + py * T[1, 2] + pz * T[2, 2], lamps.even
    nx, ny, nz = normal[0], normal[1], normal[2]
    light = 0.0
    for n in range(lamp_w.shape[1]):
        x, y, z = px - lamp_w[0, n], py - lamp_w[1, n], pz - lamp_w[2, n]
        square_near = 1.0 / (x * x + y * y + z * z)
        near = np.sqrt(square_near)
        forward = (ahead - lamps.place[2, n]) * near
        square = max(-(x * nx + y * ny + z * nz), 0.0) * near
        value = lamps.share[n] * (even + (1.0 - even) * forward) * square * square_near
        light += value if forward > 0.0 else 0.0
    return REFERENCE_MM * REFERENCE_MM * light


@summing_kernel
def _glossy_light(
    lamps: Lamps, lamp_w: Float, texture: Texture, T: Float, px: float, py: float, pz: float, ray: Float,
    normal: Float, facing: float,
) -> float:  # fmt: skip
    """Return the light of bare LEDs on a partly glossy wall."""
    ahead, even = px * T[0, 2] + py * T[1, 2] + pz * T[2, 2], lamps.even
    nx, ny, nz, rx, ry, rz = normal[0], normal[1], normal[2], ray[3], ray[4], ray[5]
    light = 0.0
    for n in range(lamp_w.shape[1]):
        x, y, z = px - lamp_w[0, n], py - lamp_w[1, n], pz - lamp_w[2, n]
        square_near = 1.0 / (x * x + y * y + z * z)
        near = np.sqrt(square_near)
        forward = (ahead - lamps.place[2, n]) * near
        square = max(-(x * nx + y * ny + z * nz), 0.0) * near
        halfway = (square + facing) * (square + facing) / (2.0 + 2.0 * (x * rx + y * ry + z * rz) * near)
        value = lamps.share[n] * (even + (1.0 - even) * forward) * square * square_near
        value *= sheen_at(texture, halfway)
        light += value if forward > 0.0 else 0.0
    return REFERENCE_MM * REFERENCE_MM * light


@kernel
def _narrow_light(
    lamps: Lamps, lamp_w: Float, texture: Texture, T: Float, px: float, py: float, pz: float, ray: Float,
    normal: Float, facing: float,
) -> float:  # fmt: skip
    """Return the light of LEDs that emit by any power of the cosine."""
    ahead, even = px * T[0, 2] + py * T[1, 2] + pz * T[2, 2], lamps.even
    light = 0.0
    for n in range(lamp_w.shape[1]):
        x, y, z = px - lamp_w[0, n], py - lamp_w[1, n], pz - lamp_w[2, n]
        near = 1.0 / np.sqrt(x * x + y * y + z * z)
        forward = (ahead - lamps.place[2, n]) * near
        square = -(x * normal[0] + y * normal[1] + z * normal[2]) * near
        if forward > 0.0 and square > 0.0:
            along = (x * ray[3] + y * ray[4] + z * ray[5]) * near
            sheen = sheen_at(texture, (square + facing) ** 2 / (2.0 + 2.0 * along))
            value = lamps.share[n] * (even + (1.0 - even) * forward**lamps.lobe)
            light += value * square * near * near * sheen
    return REFERENCE_MM * REFERENCE_MM * light
