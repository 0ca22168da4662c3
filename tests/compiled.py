"""Compile the inner loops of a run once, so that the test processes do not each compile them."""

from pipeline.cli import kernels_of_a_run
from pipeline.system.kernels import compile_all

if __name__ == "__main__":
    compile_all(kernels_of_a_run())
