"""Settings of every run of the tests."""

import gc
import os

# Each worker of a run fills a core: threads of linear algebra would only wait for one another.
# NumPy reads it when it is loaded, which is after this file.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def pytest_collection_finish():
    """Modules and tests stay until the end: the collector need not walk through them again."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
