"""The physics that is known to make a recording differ from the plain instrument: names, units, laws."""
