"""What coded pictures tell before they are decoded: H.264 recovery points and checksums of FFV1 slices."""

from __future__ import annotations

import zlib

_SLICES = (1, 2, 3, 4, 5)
_LENGTH_PREFIXED = 1
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


def length_bytes(extradata: bytes | None) -> int:
    """Return of how many bytes the lengths before units are (ISO/IEC 14496-15); 0 where units have none."""
    if not extradata or len(extradata) < 5 or extradata[0] != _LENGTH_PREFIXED:
        return 0
    return (extradata[4] & 3) + 1


def is_reference(packet: bytes, length_size: int) -> bool:
    """Tell whether others may be predicted from a coded picture: its first slice says; True where unknown."""
    at = 0
    while length_size and at + length_size < len(packet):
        length = int.from_bytes(packet[at : at + length_size], "big")
        header = packet[at + length_size]
        if header & 31 in _SLICES:
            return header >> 5 & 3 != 0
        at += length_size + length
    return True
