"""Write the plugin as a zip file, which QGIS installs by Plugins > Install from ZIP.

python qgis/package.py [FOLDER]
"""

import sys
import zipfile
from pathlib import Path

PLUGIN = Path(__file__).parent / "aosplan_qgis"


def package(folder: Path) -> Path:
    """Write ``aosplan_qgis.zip`` into ``folder`` and return its path. The bytes are reproducible."""
    path = folder / "aosplan_qgis.zip"
    files = sorted([*PLUGIN.glob("*.py"), PLUGIN / "metadata.txt"])
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in [*files, PLUGIN.parent.parent / "LICENSE"]:
            entry = zipfile.ZipInfo(f"aosplan_qgis/{file.name}", (1980, 1, 1, 0, 0, 0))
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, file.read_bytes())
    return path


if __name__ == "__main__":
    print(package(Path(sys.argv[1] if len(sys.argv) > 1 else ".")))
