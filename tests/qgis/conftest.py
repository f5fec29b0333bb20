collect_ignore = ["run_plugin.py"]  # This file runs in the Python of QGIS.
