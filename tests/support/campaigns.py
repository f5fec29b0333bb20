"""A sweep for tests.  It has combinations of options of a uniform scene; some of the combinations
have no solution.
"""

from aosplan.cli.app import run

CAMPAIGN = """
[sweep]
altitude = { start = 10, stop = 120, count = 6 }
vhat = [0.9, "98%"]
max_aperture = [8, 40]
density = { start = 0.001, stop = 0.02, count = 4, spacing = "log" }
occluder_size = 0.2
volume_height = 15
"""


def sweep(*arguments):
    """Exit status of `aosplan sweep`."""
    return run(["sweep", *map(str, arguments)])


def contents(folder):
    """The content of every file in a folder, by name."""
    return {entry.name: entry.read_bytes() for entry in folder.iterdir()}
