"""Light that reaches each pixel: of the laser's line, and of the LEDs."""

from __future__ import annotations

import numpy as np

from pipeline.simulator.kernel import kernel, owner
from pipeline.simulator.rays import ray_at
from pipeline.simulator.sheet import density_at, sheet_at
from pipeline.simulator.surface import meet, normal_at, radius_at
from pipeline.simulator.texture import albedo_at
from pipeline.simulator.view import TILE_PX, to_wall

REFERENCE_MM = 50.0
# The glossy lobe is left out where it is below e to the minus this.
_NO_LOBE = 16.0
_PATCH_PX = 16


@owner
def _work():  # type: ignore[no-untyped-def]
    """Return room for a ray in C and W, a hit, its section, its normal, its reflectance, and two vectors."""
    return (
        np.empty(6), np.empty(6), np.empty(4), np.empty(3), np.empty((3, 3)), np.empty(3), np.empty(3),
        np.empty(3), np.empty(3),
    )  # fmt: skip


@owner
def add_line(view, line, colour, gain, speckle, tiles, samples, v_from, v_to, image):  # type: ignore[no-untyped-def]
    """Add a line's light to rows v_from … v_to of an image (H, W, 3), in the tiles that it may touch.

    ``speckle`` is (contrast, grain in mm, seed).
    """
    work = _work()
    total, times = np.empty(3), view.pose.shape[1]
    share = gain / (samples * samples * times)
    for v in range(v_from, v_to):
        for u in range(image.shape[1]):
            if not tiles[v // TILE_PX, u // TILE_PX]:
                continue
            if not _near_line(view, line, u, v, times, work):
                continue
            total[:] = 0.0
            for n in range(samples * samples):
                y = v + (n // samples + 0.5) / samples - 0.5
                x = u + (n % samples + 0.5) / samples - 0.5
                ray_at(view.rays, x, y, work[0])
                for k in range(times):
                    _line_light(view, line, speckle, v, k, samples, work, total)
            for c in range(3):
                image[v, u, c] += share * colour[c] * total[c]


@kernel
def _near_line(view, line, u, v, times, work):  # type: ignore[no-untyped-def]
    """Tell whether a pixel's middle comes as near to the line as any of its parts may, at some moment."""
    c_ray, w_ray, hit, o, R, normal, _, _, _ = work
    ray_at(view.rays, u, v, c_ray)
    if not (c_ray[5] > -0.5):
        return False
    for k in range(times):
        to_wall(view, v, k, c_ray, w_ray)
        if not meet(view.surface, w_ray, view.distance_mm, o, R, hit):
            continue
        x, y, z = c_ray[0] + hit[0] * c_ray[3], c_ray[1] + hit[0] * c_ray[4], c_ray[2] + hit[0] * c_ray[5]
        height, slope, _ = sheet_at(line.sheet, 0.5, np.arctan2(y, x))
        above = z - height - np.sqrt(x * x + y * y) * slope
        normal_at(view.surface, hit, R, normal)
        facing = abs(w_ray[3] * normal[0] + w_ray[4] * normal[1] + w_ray[5] * normal[2])
        room = 1.5 * hit[0] / (view.px_per_rad * max(facing, 0.02)) + line.wobble_mm
        high = line.profile.low + line.profile.step * (line.profile.density.shape[0] - 1)
        if above > line.profile.low - room and above < high + room:
            return True
    return False


@kernel
def _line_light(view, line, speckle, row, k, samples, work, total):  # type: ignore[no-untyped-def]
    c_ray, w_ray, hit, o, R, normal, albedo, way, _ = work
    if not (c_ray[5] > -0.5):
        return
    to_wall(view, row, k, c_ray, w_ray)
    if not meet(view.surface, w_ray, view.distance_mm, o, R, hit):
        return
    x, y, z = c_ray[0] + hit[0] * c_ray[3], c_ray[1] + hit[0] * c_ray[4], c_ray[2] + hit[0] * c_ray[5]
    q = np.sqrt(x * x + y * y)
    moment = view.moment[min(row, view.moment.shape[0] - 1), k]
    height, slope, weight = sheet_at(line.sheet, moment, np.arctan2(y, x))
    steep = np.sqrt(1.0 + slope * slope)
    density = density_at(line.profile, (z - height - q * slope) / steep)
    if density <= 0.0:
        return
    normal_at(view.surface, hit, R, normal)
    T = view.pose[min(row, view.pose.shape[0] - 1), k]
    for a in range(3):
        way[a] = (T[a, 0] * x / q + T[a, 1] * y / q + T[a, 2] * slope) / steep
    square = -(normal[0] * way[0] + normal[1] * way[1] + normal[2] * way[2])
    if square <= 0.0:
        return
    foot = hit[0] / (view.px_per_rad * samples)
    albedo_at(view.texture, hit[1], hit[2], foot, albedo)
    light = weight * density * square * REFERENCE_MM / q * _sheen(view.texture, normal, way, w_ray)
    if speckle[0] > 0.0:
        light *= _speckle(speckle, hit)
    for c in range(3):
        total[c] += light * albedo[c]


@kernel
def _sheen(texture, normal, way, ray):  # type: ignore[no-untyped-def]
    """Return what a partly glossy wall sends to the camera over what a dull one would (Blinn-Phong)."""
    if texture.gloss <= 0.0:
        return 1.0
    a, b, c = -way[0] - ray[3], -way[1] - ray[4], -way[2] - ray[5]
    size = np.sqrt(a * a + b * b + c * c) + 1e-12
    cosine = max((a * normal[0] + b * normal[1] + c * normal[2]) / size, 0.0)
    if texture.lobe * (1.0 - cosine) > _NO_LOBE:
        return 1.0 - texture.gloss
    return 1.0 - texture.gloss + texture.gloss * (texture.lobe + 8.0) / 8.0 * cosine**texture.lobe


@kernel
def _speckle(speckle, hit):  # type: ignore[no-untyped-def]
    """Return the factor, mean 1, of the speckle cell that a hit lies in."""
    contrast, grain, seed = speckle
    i = np.uint64(np.int64(np.floor(hit[1] / grain)))
    j = np.uint64(np.int64(np.floor(hit[2] * hit[3] / grain)))
    h = hashed(i * np.uint64(0x9E3779B97F4A7C15) + j * np.uint64(0xC2B2AE3D27D4EB4F) + np.uint64(seed))
    uniform = (np.float64(h >> np.uint64(11)) + 0.5) / 9007199254740992.0
    return 1.0 - contrast - contrast * np.log(uniform)


@kernel
def hashed(x):  # type: ignore[no-untyped-def]
    """Return 64 well mixed bits of 64 bits (finaliser of splitmix64, Steele et al. 2014)."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@owner
def add_wall_light(view, leds, emission, colour, level, ambient, samples, v_from, v_to, image):  # type: ignore[no-untyped-def]
    """Add what LEDs at ``leds`` (L, 3) in C, and even stray light, make of the wall, to rows of an image.

    ``emission`` is the exponent of their lobe and the even share: see `LedRing`.
    """
    work, total = _work(), np.empty(3)
    across = -(-image.shape[1] // _PATCH_PX)
    # in patches, so that neighbours find the wall's samples still at hand
    for patch in range(across * -(-(v_to - v_from) // _PATCH_PX)):
        v_first, u_first = v_from + patch // across * _PATCH_PX, patch % across * _PATCH_PX
        for v in range(v_first, min(v_first + _PATCH_PX, v_to)):
            for u in range(u_first, min(u_first + _PATCH_PX, image.shape[1])):
                _pixel_wall_light(view, leds, emission, level, ambient, samples, u, v, work, total)
                for c in range(3):
                    image[v, u, c] += colour[c] * total[c]


@kernel
def _pixel_wall_light(view, leds, emission, level, ambient, samples, u, v, work, total):  # type: ignore[no-untyped-def]
    times = view.pose.shape[1]
    total[:] = 0.0
    for n in range(samples * samples):
        y = v + (n // samples + 0.5) / samples - 0.5
        x = u + (n % samples + 0.5) / samples - 0.5
        ray_at(view.rays, x, y, work[0])
        for k in range(times):
            _wall_light(view, leds, emission, level, ambient, v, k, samples, work, total)
    for c in range(3):
        total[c] /= samples * samples * times


@kernel
def _wall_light(view, leds, emission, level, ambient, row, k, samples, work, total):  # type: ignore[no-untyped-def]
    c_ray, w_ray, hit, o, R, normal, albedo, way, at = work
    # LEDs face forward and sit about at the viewpoint
    if not (c_ray[5] > (-0.05 if ambient == 0.0 else -1.0)):
        return
    to_wall(view, row, k, c_ray, w_ray)
    if not meet(view.surface, w_ray, view.distance_mm, o, R, hit):
        return
    normal_at(view.surface, hit, R, normal)
    facing = -(w_ray[3] * normal[0] + w_ray[4] * normal[1] + w_ray[5] * normal[2])
    if facing <= 0.0:
        return
    T = view.pose[min(row, view.pose.shape[0] - 1), k]
    light = ambient
    hidden = _may_hide(view.surface, hit, T, o, R)
    for a in range(3):
        at[a] = T[0, a] * normal[0] + T[1, a] * normal[1] + T[2, a] * normal[2]
    for n in range(leds.shape[0]):
        x = c_ray[0] + hit[0] * c_ray[3] - leds[n, 0]
        y = c_ray[1] + hit[0] * c_ray[4] - leds[n, 1]
        z = c_ray[2] + hit[0] * c_ray[5] - leds[n, 2]
        d2 = x * x + y * y + z * z
        size = 1.0 / np.sqrt(d2)
        forward, square = z * size, -(x * at[0] + y * at[1] + z * at[2]) * size
        if forward <= 0.0 or square <= 0.0:
            continue
        way[0], way[1], way[2] = x * size, y * size, z * size
        if hidden and _shaded(view.surface, hit, T, way, 1.0 / size, o, R):
            continue
        lobe = forward if emission[0] == 1.0 else forward ** emission[0]
        emitted = emission[1] + (1.0 - emission[1]) * lobe
        sheen = _sheen(view.texture, at, way, c_ray)
        light += level / leds.shape[0] * emitted * square * REFERENCE_MM**2 / d2 * sheen
    albedo_at(view.texture, hit[1], hit[2], hit[0] / (view.px_per_rad * samples * max(facing, 0.05)), albedo)
    for c in range(3):
        total[c] += light * albedo[c]


@kernel
def _may_hide(surface, hit, T, o, R):  # type: ignore[no-untyped-def]
    """Tell whether the wall between a hit and the camera stands in far enough to hide the LEDs."""
    along = R[0, 2] * (o[0] - T[0, 3]) + R[1, 2] * (o[1] - T[1, 3]) + R[2, 2] * (o[2] - T[2, 3])
    if along <= 1.0:
        return False
    back = 0.5
    while back < min(along, 64.0):
        k = min(max(int(hit[1] - back - surface.from_mm), 0), surface.floor_mm.shape[1] - 1)
        if surface.floor_mm[0, k] < hit[3] * (1.0 - back / along) + 11.0 * back / along:
            return True
        back *= 2.0
    return False


@kernel
def _shaded(surface, hit, T, way, distance, o, R):  # type: ignore[no-untyped-def]
    """Tell whether the wall stands between a hit and an LED; the section's frame is taken as straight.

    ``way`` is the light's direction in C, ``T`` takes C to W.
    """
    c, s, dx, dy, dz = np.cos(hit[2]), np.sin(hit[2]), 0.0, 0.0, 0.0
    for a in range(3):
        turned = -(T[a, 0] * way[0] + T[a, 1] * way[1] + T[a, 2] * way[2])
        dx += R[a, 0] * turned
        dy += R[a, 1] * turned
        dz += R[a, 2] * turned
    step = 0.3
    back = step
    while back < min(distance, 40.0):
        x, y = hit[3] * c + back * dx, hit[3] * s + back * dy
        rho = np.sqrt(x * x + y * y)
        if rho < surface.least_mm:
            return False
        if radius_at(surface, hit[1] + back * dz, np.arctan2(y, x)) < rho - 0.01:
            return True
        step *= 1.25
        back += step
    return False
