"""``python -m pipeline.simulator.laws [FILE]``: write the table of agreement."""

import sys
from pathlib import Path

from pipeline.simulator.laws.table import all_checks, table_text

file = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("data/effects/laws.md")
file.parent.mkdir(parents=True, exist_ok=True)
file.write_text(table_text(list(all_checks())), "utf-8")
