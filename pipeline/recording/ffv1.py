"""Checksums of FFV1 frames, which FFmpeg checks but conceals (RFC 9043, section 4.9, slice footer)."""

from __future__ import annotations

import zlib

_FOOTER_BYTES = 8
_MIRRORED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


def checksums_hold(packet: bytes) -> bool:
    """Tell whether a coded frame is a row of slices whose checksums are right.

    Each slice ends with its length (3 bytes), a status (1) and what makes the CRC of the whole slice 0 (4).
    Frames coded without checksums do not pass either.
    """
    end = len(packet)
    while end >= _FOOTER_BYTES:
        length = int.from_bytes(packet[end - 8 : end - 5], "big") + _FOOTER_BYTES
        if length > end or _remainder(packet[end - length : end]):
            return False
        end -= length
    return end == 0 and len(packet) > 0


def _remainder(data: bytes) -> int:
    """Return the CRC-32 of RFC 9043, which takes bits the other way round than zlib and starts from 0."""
    return zlib.crc32(data.translate(_MIRRORED), 0xFFFFFFFF) ^ 0xFFFFFFFF
