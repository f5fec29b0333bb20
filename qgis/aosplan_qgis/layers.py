"""Turn the JSON document of a plan into features of layers in WGS 84."""

from qgis.core import (
    QgsCoordinateReferenceSystem,
    QgsCoordinateTransform,
    QgsFeature,
    QgsField,
    QgsFields,
    QgsGeometry,
    QgsPoint,
    QgsPointXY,
    QgsProject,
)
from qgis.PyQt.QtCore import QVariant

WGS84 = QgsCoordinateReferenceSystem("EPSG:4326")


def fields(**kinds):
    """Return fields with the given names.  Each kind is int or float."""
    made = QgsFields()
    for name, kind in kinds.items():
        made.append(QgsField(name, QVariant.Int if kind is int else QVariant.Double))
    return made


SITE_FIELDS = fields(index=int, flight=int, east_m=float, north_m=float, altitude_m=float)
PATH_FIELDS = fields(flight=int, photos=int, length_m=float, time_s=float)
FOOTPRINT_FIELDS = fields(index=int, flight=int)


def flights(document):
    """Return (number, waypoints, totals) of each flight, counted from 1."""
    return [
        (number, document["waypoints"][flight["first"] : flight["last"] + 1], flight)
        for number, flight in enumerate(document["flight"]["flights"], start=1)
    ]


def _photos(document):
    """Return (flight number, waypoint) of each photo.  Run-ins and run-outs have no photos."""
    for number, waypoints, _ in flights(document):
        for waypoint in waypoints:
            if waypoint.get("photo", True):
                yield number, waypoint


def site_features(document):
    """Return a point with height above ground for each photo, in flight order."""
    for number, waypoint in _photos(document):
        point = QgsPoint(waypoint["longitude"], waypoint["latitude"], waypoint["altitude_m"])
        values = [waypoint[name] for name in ("index", "east_m", "north_m", "altitude_m")]
        yield _feature(SITE_FIELDS, QgsGeometry(point), [values[0], number, *values[1:]])


def path_features(document):
    """Return the line of each flight, with run-ins and run-outs, if it has at least two waypoints."""
    for number, waypoints, flight in flights(document):
        points = [QgsPoint(w["longitude"], w["latitude"], w["altitude_m"]) for w in waypoints]
        if len(points) > 1:
            values = [number, flight["samples"], flight["length_m"], flight["time_s"]]
            yield _feature(PATH_FIELDS, QgsGeometry.fromPolyline(points), values)


def footprint_features(document):
    """Return the rectangle that each photo shows of level ground."""
    along, across = document["camera"]["footprint_m"]
    for number, waypoint in _photos(document):
        place = QgsPointXY(waypoint["longitude"], waypoint["latitude"])
        rectangle = QgsGeometry.fromPolygonXY([_corners(along, across)])
        # Metres in an azimuthal projection around the photo; QGIS rotates clockwise.
        rectangle.rotate(document["flight"]["yaw_deg"], QgsPointXY(0, 0))
        local = QgsCoordinateReferenceSystem.fromProj(
            f"+proj=aeqd +lat_0={place.y()!r} +lon_0={place.x()!r} +datum=WGS84 +units=m"
        )
        rectangle.transform(QgsCoordinateTransform(local, WGS84, QgsProject.instance()))
        yield _feature(FOOTPRINT_FIELDS, rectangle, [waypoint["index"], number])


def _corners(along, across):
    """Return the corners of a rectangle around (0, 0).  `along` is to the north, and `across` is to
    the east.
    """
    signs = ((-1, -1), (-1, 1), (1, 1), (1, -1), (-1, -1))
    return [QgsPointXY(x * across / 2, y * along / 2) for x, y in signs]


def _feature(kinds, geometry, values):
    feature = QgsFeature(kinds)
    feature.setGeometry(geometry)
    feature.setAttributes(values)
    return feature
