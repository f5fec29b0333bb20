"""What all tests share: the reference implementation on the path, and no deadlines."""

import os
import sys
from pathlib import Path

from hypothesis import settings

# Tests say `from reference import exact`, whatever folder pytest is started in.
sys.path.insert(0, str(Path(__file__).parent))

# No test reads what another run, or the user, has left in the cache, nor anyone's defaults.
os.environ["AOSPLAN_CACHE"] = "0"
os.environ["AOSPLAN_DEFAULTS"] = "none"

# Time is measured by benchmarks, never by tests.
# In CI the examples are the same every time; on a desk they are new ones.
settings.register_profile(
    "aosplan",
    parent=settings.get_profile("default"),
    deadline=None,
    derandomize=bool(os.environ.get("CI")),
)
settings.load_profile("aosplan")
