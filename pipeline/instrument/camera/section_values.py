"""Values that camera files share, read from a YAML section with complaints that name the key."""

from __future__ import annotations

from pipeline.files.yaml_file import Section

LARGEST_SIDE_PX = 65535


def pair(section: Section, key: str) -> tuple[float, float]:
    """Return two finite numbers."""
    first, second = section.numbers(key, 2)
    return first, second


def positive(section: Section, key: str, values: tuple[float, ...]) -> tuple[float, ...]:
    """Return ``values`` read from ``key``, all of which must be greater than 0."""
    for i, value in enumerate(values):
        if value <= 0:
            raise section.fail(f"{key}[{i}]", f"is {value:g}", "a number greater than 0")
    return values


def focal_pair(section: Section, key: str) -> tuple[float, float]:
    """Return two numbers greater than 0."""
    first, second = positive(section, key, section.numbers(key, 2))
    return first, second


def number_list(section: Section, key: str, least: int, most: int) -> tuple[float, ...]:
    """Return a list of ``least`` to ``most`` finite numbers."""
    expected = f"a list of {least} to {most} numbers"
    value = section.require(key, expected)
    if not isinstance(value, list) or not least <= len(value) <= most:
        found = f"a list of {len(value)}" if isinstance(value, list) else f"a {type(value).__name__}"
        raise section.fail(key, f"is {found}", expected)
    return section.numbers(key, len(value))


def image_size(section: Section, key: str) -> tuple[int, int]:
    """Return [width, height], whole pixels."""
    expected = f"[width, height] in whole pixels from 1 to {LARGEST_SIDE_PX}"
    value = section.require(key, expected)
    if not isinstance(value, list) or len(value) != 2:
        raise section.fail(key, f"is a {type(value).__name__}", expected)
    return _side(section, key, value[0], expected), _side(section, key, value[1], expected)


def side(section: Section, key: str) -> int:
    """Return a width or height, whole pixels."""
    expected = f"a whole number of pixels from 1 to {LARGEST_SIDE_PX}"
    return _side(section, key, section.require(key, expected), expected)


def _side(section: Section, key: str, value: object, expected: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= LARGEST_SIDE_PX:
        raise section.fail(key, f"holds {str(value)[:40]!r}", expected)
    return value
