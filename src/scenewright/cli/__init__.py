"""What people and machines run: the command line."""

import os

# The matrices of the encoder are small: threads of OpenBLAS spin while they wait for each other,
# six times the processor time with two. Read once, when numpy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
