"""QGIS plugin: one Processing provider, which runs the program ``aosplan``."""


def classFactory(iface):
    """Return the plugin. QGIS calls this function once."""
    from .plugin import AosplanPlugin

    return AosplanPlugin()
