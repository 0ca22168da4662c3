"""What boresight asks of the operating system: threads, processes, signals, native libraries."""
