collect_ignore = ["run_plugin.py"]  # runs in the Python of QGIS
