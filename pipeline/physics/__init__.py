"""Known effects that make a recording differ from that of the ideal instrument: names, units, laws."""
