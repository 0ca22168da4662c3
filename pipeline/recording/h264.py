"""Which coded pictures of an H.264 stream no other picture is predicted from (ITU-T H.264, section 7.4.1)."""

from __future__ import annotations

_SLICES = (1, 2, 3, 4, 5)
_LENGTH_PREFIXED = 1


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
