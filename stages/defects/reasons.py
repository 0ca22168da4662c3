"""Why a finding is not counted: sentences for the reader, without their full stop."""

STAYS_IN_IMAGE = (
    "It stays at one place of the image while the wall goes by, as something on the window or on the probe "
    "does. To tell: clean the window, or roll the probe by 30°, and record again"
)
BESIDE_LINE = (
    "A bright spot of the wall beside the line was taken for it: the spot stays in place while the line "
    "passes, and without the rings that show it there is no such depth"
)
SHOWN_WITHOUT = (
    "Lit pictures taken before and after, when the line was elsewhere, show the wall without it: a drop or "
    "dirt on the window may have moved the line while it passed"
)
SHOWN_DISPLACED = (
    "Lit pictures show the wall displaced there, but only while the line passed it: a drop or dirt on the "
    "window may have moved the line as well"
)
DROVE_THROUGH = (
    "The probe drove past it, and its lamps would have struck it there: a reflection or stray light was "
    "taken for the line"
)
AT_EDGE = (
    "It is deepest where the wall ceases to be seen: the line ends there, and what hides the wall may have "
    "drawn it aside"
)
ALONE = (
    "No second, independent ring shows it, nor do one ring and the photo together. A ring does not count "
    "where a glint, a second line or a splash was rejected beside it"
)
LIKE_GLINT = (
    "The line is brighter there than at nine of ten places of its ring, as of a glint or a reflection, and "
    "more findings of this recording are that bright than chance explains"
)
WEAK = "In this recording, more findings of this strength are expected to be false than real"
BEHIND_STATIC = (
    "Something stays in the picture there while the wall moves, such as burnt-in text, dirt on the window or "
    "a part of the probe: it may have been taken for the line. To tell: switch the text off, clean the "
    "window, or roll the probe by 30°, and record again"
)
