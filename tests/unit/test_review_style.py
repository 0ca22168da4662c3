"""The review's colours: text readable, controls and focus visible, in light and dark mode (WCAG 2.2 AA)."""

import re

import pytest

from tests.shared_data import PROJECT_ROOT

STYLE = (PROJECT_ROOT / "pipeline/review/page/src/style.css").read_text("utf-8")
BUILT = (PROJECT_ROOT / "pipeline/review/page/dist/assets/style.css").read_text("utf-8")
GROUNDS = ("bg", "surface")
TEXT = ("ink", "muted", "accent", "chosen", "accepted", "bad")
# Visible parts that are not text: edges of fields and buttons, focus, dots, curves.
SHAPES = ("edge", "chosen", "accent", "open", "accepted", "rejected", "muted", "ink")


def themes():
    blocks = re.findall(r":root\s*\{([^}]*)\}", STYLE)
    light, dark = (dict(re.findall(r"--([\w-]+):\s*(#[0-9a-f]{6})", b)) for b in blocks)
    return {"light": light, "dark": light | dark}


def luminance(colour):
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one, other):
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def test_contrast_is_computed_as_in_the_standard():
    assert contrast("#000000", "#ffffff") == pytest.approx(21)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_text_is_readable(theme):
    colour = themes()[theme]
    pairs = [(text, ground) for text in TEXT for ground in GROUNDS] + [
        ("on-accent", "accent"),
        ("ink", "halo"),
    ]
    poor = {pair: round(contrast(*(colour[c] for c in pair)), 2) for pair in pairs}
    assert {pair: c for pair, c in poor.items() if c < 4.5} == {}


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_controls_and_focus_are_visible(theme):
    colour = themes()[theme]
    poor = {(s, g): round(contrast(colour[s], colour[g]), 2) for s in SHAPES for g in GROUNDS}
    assert {pair: c for pair, c in poor.items() if c < 3} == {}


def test_both_themes_define_the_same_colours_and_all_text_uses_them():
    blocks = re.findall(r":root\s*\{([^}]*)\}", STYLE)
    light, dark = (set(re.findall(r"--([\w-]+):\s*#", b)) for b in blocks)
    assert light == dark
    rules = re.sub(r":root\s*\{[^}]*\}", "", STYLE)
    assert set(re.findall(r"(?<![\w-])(?:color|border-color):\s*([^;}]+)", rules)) <= {
        "inherit", "currentColor", "var(--ink)", "var(--muted)", "var(--accent)", "var(--on-accent)",
        "var(--chosen)", "var(--accepted)", "var(--rejected)",
    }  # fmt: skip


def test_controls_have_a_visible_edge_and_focus_is_drawn():
    assert re.search(r"button, select, input, textarea \{[^}]*border: 1px solid var\(--edge\)", STYLE)
    assert re.search(r":focus-visible \{ outline: 3px solid var\(--chosen\)", STYLE)
    assert "outline: none" not in STYLE


def test_the_build_is_made_from_the_source():
    assert BUILT == STYLE
