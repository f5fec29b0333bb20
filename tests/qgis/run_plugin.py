"""Run the plugin in QGIS without a screen, and print its results as JSON.

This is not a test module: tests/qgis/test_plugin.py starts it with the Python that has
``qgis.core``.

    python3 run_plugin.py PLUGIN_ZIP JSON_OF_PARAMETERS
"""

import json
import sys

sys.path.insert(0, sys.argv[1])
sys.path.append("/usr/share/qgis/python/plugins")

from aosplan_qgis import classFactory
from processing.core.Processing import Processing
from qgis.core import (
    QgsApplication,
    QgsCoordinateReferenceSystem,
    QgsDistanceArea,
    QgsProcessingException,
    QgsProcessingFeedback,
    QgsProject,
)

application = QgsApplication([], False)
application.initQgis()
import processing  # noqa: E402 (QGIS has to be initialised)

Processing.initialize()
plugin = classFactory(None)
plugin.initProcessing()


class Feedback(QgsProcessingFeedback):
    """A log that collects its lines."""

    def __init__(self):
        super().__init__()
        self.lines = []

    def pushWarning(self, text):  # noqa: N802
        self.lines.append(f"warning: {text}")

    def pushInfo(self, text):  # noqa: N802
        self.lines.append(text)


parameters = json.loads(sys.argv[2])
feedback = Feedback()
result = {"parameters": {}, "log": feedback.lines}
algorithm = QgsApplication.processingRegistry().algorithmById("aosplan:plan")
for definition in algorithm.parameterDefinitions():
    result["parameters"][definition.name()] = definition.type()
area = QgsDistanceArea()
area.setSourceCrs(
    QgsCoordinateReferenceSystem("EPSG:4326"), QgsProject.instance().transformContext()
)
area.setEllipsoid("WGS84")
try:
    for name, layer in processing.run("aosplan:plan", parameters, feedback=feedback).items():
        if not hasattr(layer, "getFeatures"):
            result[name] = layer
            continue
        result[name] = [
            {
                "shape": json.loads(feature.geometry().asJson(12)),
                "area_m2": area.measureArea(feature.geometry()),
                **feature.attributeMap(),
            }
            for feature in layer.getFeatures()
        ]
except QgsProcessingException as error:
    result["error"] = str(error)
plugin.unload()
print(json.dumps(result))
