"""The algorithm "Plan a flight", which converts parameters to options and the document to layers."""

import shlex
import tempfile
from pathlib import Path

from qgis.core import (
    QgsCoordinateTransform,
    QgsFeatureSink,
    QgsGeometry,
    QgsProcessing,
    QgsProcessingAlgorithm,
    QgsProcessingException,
    QgsProcessingParameterDefinition,
    QgsProcessingParameterEnum,
    QgsProcessingParameterFeatureSink,
    QgsProcessingParameterFeatureSource,
    QgsProcessingParameterFile,
    QgsProcessingParameterFileDestination,
    QgsProcessingParameterNumber,
    QgsProcessingParameterPoint,
    QgsProcessingParameterRasterDestination,
    QgsProcessingParameterRasterLayer,
    QgsProcessingParameterString,
    QgsProject,
    QgsSettings,
    QgsWkbTypes,
)

from . import layers
from .program import ProgramError, find_program, names, run_json

_SETTING = "aosplan/program"
_MISSIONS = (
    "DJI WPML (*.kmz);;QGroundControl plan (*.plan);;ArduPilot waypoints (*.waypoints);;"
    "KML (*.kml);;CSV (*.csv);;GeoJSON (*.geojson);;Parrot (*.mavlink)"
)


class PlanAlgorithm(QgsProcessingAlgorithm):
    """Runs ``aosplan plan`` for an area or a point and adds its plan as layers."""

    def createInstance(self):
        return PlanAlgorithm()

    def name(self):
        return "plan"

    def displayName(self):
        return "Plan a flight"

    def shortHelpString(self):
        return (
            "Plans the photos of airborne optical sectioning over an area, or around a point.\n"
            "Each parameter is the option of 'aosplan plan' with the same name. If a parameter is "
            "empty, the default of this option is used. Any other option can be given under "
            "Advanced parameters. Warnings of aosplan appear in the log. Read them before you fly."
        )

    def initAlgorithm(self, configuration=None):
        self.addParameter(
            QgsProcessingParameterFeatureSource(
                "AREA", "Area to cover", [QgsProcessing.TypeVectorPolygon], optional=True
            )
        )
        self.addParameter(
            QgsProcessingParameterPoint("ORIGIN", "Or one place: centre of the grid", optional=True)
        )
        self._add_text("ALTITUDE", "Altitude [m], or a range such as 40..80 with minutes", "40")
        self._add_names("DRONE", "Drone", "drones")
        self._add_names("SCENE", "Forest", "scenes")
        self.addParameter(
            QgsProcessingParameterFile(
                "SCENE_FILE", "Or a point cloud or a scene file of the forest", optional=True
            )
        )
        self.addParameter(
            QgsProcessingParameterNumber(
                "VHAT",
                "Target visibility V̂",
                QgsProcessingParameterNumber.Double,
                optional=True,
                minValue=0,
                maxValue=1,
            )
        )
        self.addParameter(
            QgsProcessingParameterNumber(
                "MINUTES",
                "Minutes from take-off to landing: the best plan within this time",
                QgsProcessingParameterNumber.Double,
                optional=True,
                minValue=0,
            )
        )
        self._add_text("FIND", "Target to find: person, or width x length in metres (0.5x1.7)")
        self._add_text("HEADING", "Heading of the flight lines [degrees], or auto")
        self.addParameter(
            QgsProcessingParameterRasterLayer("TERRAIN", "Elevation model to follow", optional=True)
        )
        self._add_text("OPTIONS", "Other options, as on the command line", advanced=True)
        self._add_text(
            "PROGRAM",
            "Path of the program aosplan, if it is not found",
            QgsSettings().value(_SETTING, ""),
            advanced=True,
        )
        for name, title, kind, created in (
            ("SITES", "Sites of the photos", QgsProcessing.TypeVectorPoint, True),
            ("PATH", "Flight path", QgsProcessing.TypeVectorLine, True),
            ("FOOTPRINTS", "Footprints of the photos", QgsProcessing.TypeVectorPolygon, False),
        ):
            self.addParameter(
                QgsProcessingParameterFeatureSink(
                    name, title, kind, optional=True, createByDefault=created
                )
            )
        self.addParameter(
            QgsProcessingParameterRasterDestination(
                "DETECTION",
                "Probability of detection (needs a target to find)",
                optional=True,
                createByDefault=False,
            )
        )
        for name, title, pattern in (
            ("MISSION", "Mission file for the drone", _MISSIONS),
            ("REPORT", "Report", "HTML (*.html)"),
        ):
            self.addParameter(
                QgsProcessingParameterFileDestination(
                    name, title, pattern, optional=True, createByDefault=False
                )
            )

    def processAlgorithm(self, parameters, context, feedback):
        written = {
            "MISSION": self.parameterAsFileOutput(parameters, "MISSION", context),
            "REPORT": self.parameterAsFileOutput(parameters, "REPORT", context),
            "DETECTION": self.parameterAsOutputLayer(parameters, "DETECTION", context),
        }
        with tempfile.TemporaryDirectory(prefix="aosplan") as folder:
            arguments = self._arguments(parameters, context, Path(folder), written)
            given = self.parameterAsString(parameters, "PROGRAM", context).strip()
            try:
                program = find_program(given)
                feedback.pushCommandInfo(shlex.join([program, *arguments]))
                document = run_json(
                    program, arguments, lambda line: _report(feedback, line), feedback.isCanceled
                )
            except ProgramError as error:
                raise QgsProcessingException(str(error)) from None
        if given:
            QgsSettings().setValue(_SETTING, given)
        results = {name: path for name, path in written.items() if path}
        for name, kinds, shape, features in (
            ("SITES", layers.SITE_FIELDS, QgsWkbTypes.PointZ, layers.site_features),
            ("PATH", layers.PATH_FIELDS, QgsWkbTypes.LineStringZ, layers.path_features),
            ("FOOTPRINTS", layers.FOOTPRINT_FIELDS, QgsWkbTypes.Polygon, layers.footprint_features),
        ):
            sink, identifier = self.parameterAsSink(
                parameters, name, context, kinds, shape, layers.WGS84
            )
            if sink is not None:
                sink.addFeatures(features(document), QgsFeatureSink.FastInsert)
                results[name] = identifier
        return results

    def _arguments(self, parameters, context, folder, written):
        """Return the arguments of ``aosplan`` for the given parameters."""

        def text(name):
            return self.parameterAsString(parameters, name, context).strip()

        options = {
            "--altitude": text("ALTITUDE"),
            "--drone": text("DRONE"),
            "--scene": text("SCENE_FILE") or text("SCENE"),
            "--find": text("FIND"),
            "--heading": text("HEADING"),
            "--out": written["MISSION"],
            "--report": written["REPORT"],
            "--detection-map": written["DETECTION"],
        }
        for option, name in (("--vhat", "VHAT"), ("--within", "MINUTES")):
            if parameters.get(name) is not None:
                options[option] = repr(self.parameterAsDouble(parameters, name, context))
        if "--within" in options and "--vhat" not in options:
            options["--optimize"] = "detection" if options["--find"] else "visibility"
        area = self.parameterAsSource(parameters, "AREA", context)
        if area is not None:
            options["--area"] = _area_file(area, folder / "area.geojson")
        if parameters.get("ORIGIN"):
            place = self.parameterAsPoint(parameters, "ORIGIN", context, layers.WGS84)
            options["--origin"] = f"{place.y()!r},{place.x()!r}"
        if area is None and "--origin" not in options:
            raise QgsProcessingException("Give an area layer or a place: the plan needs one.")
        terrain = self.parameterAsRasterLayer(parameters, "TERRAIN", context)
        if terrain is not None:
            options["--terrain"] = terrain.source()
        # Each option is a single argument, so that a value may begin with a minus sign.
        arguments = [f"{option}={value}" for option, value in options.items() if value]
        # Processing asks before it overwrites files.
        return ["plan", *arguments, "--force", *shlex.split(text("OPTIONS"))]

    def _add_text(self, name, title, default=None, *, advanced=False):
        parameter = QgsProcessingParameterString(name, title, default, optional=True)
        if advanced:
            parameter.setFlags(parameter.flags() | QgsProcessingParameterDefinition.FlagAdvanced)
        self.addParameter(parameter)

    def _add_names(self, name, title, command):
        """Add a list of the program's presets, or a text if the program is not found."""
        known = names(command)
        if not known:
            self._add_text(name, title)
            return
        parameter = QgsProcessingParameterEnum(name, title, known, optional=True)
        parameter.setUsesStaticStrings(True)
        self.addParameter(parameter)


def _area_file(source, path):
    """Write the polygons of a layer, or only the selected polygons, as GeoJSON in WGS 84."""
    to_wgs84 = QgsCoordinateTransform(source.sourceCrs(), layers.WGS84, QgsProject.instance())
    shapes = []
    for feature in source.getFeatures():
        shape = QgsGeometry(feature.geometry())
        shape.transform(to_wgs84)
        shapes.append(shape.asJson(12))
    path.write_text(
        '{"type": "GeometryCollection", "geometries": [%s]}' % ", ".join(shapes),  # noqa: UP031
        encoding="utf-8",
    )
    return str(path)


def _report(feedback, line):
    """Write a line of the program's output to the log.  Warnings are written as warnings."""
    if line.startswith("warning:"):
        feedback.pushWarning(line.removeprefix("warning:").strip())
    else:
        feedback.pushInfo(line)
