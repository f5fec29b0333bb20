"""Positions of photos: EXIF and XMP as cameras write them, and as they should not."""

import pytest
from support.geotagged import photo, rational

from aosplan.errors import RequestError
from aosplan.postflight.geotags import read_photos

Image = pytest.importorskip("PIL.Image")


@pytest.mark.parametrize(
    ("latitude", "longitude"), [(48.3358, 14.3261), (-33.5, -70.25), (0.0, 179.999), (-0.5, 0.0)]
)
def test_exif_positions_are_read(tmp_path, latitude, longitude):
    photo(tmp_path / "a.jpg", latitude, longitude)
    (place,) = read_photos(str(tmp_path)).values()
    assert place.altitude_m is None
    assert place.latitude == pytest.approx(latitude, abs=1e-7)
    assert place.longitude == pytest.approx(longitude, abs=1e-7)


@pytest.mark.parametrize(
    "xmp",
    [
        b'<x:xmpmeta drone-dji:GpsLatitude="+48.123456789" drone-dji:GpsLongitude="-14.5" '
        b'drone-dji:RelativeAltitude="+40.10"/>',
        b'<x drone-dji:GpsLatitude="48.123456789" drone-dji:GpsLongtitude="-14.5" '
        b'drone-dji:RelativeAltitude="40.1"/>',
        b"<drone-dji:GpsLatitude>48.123456789</drone-dji:GpsLatitude><drone-dji:GpsLongitude>-14.5"
        b"</drone-dji:GpsLongitude><drone-dji:RelativeAltitude>40.1</drone-dji:RelativeAltitude>",
    ],
)
def test_xmp_goes_before_exif(tmp_path, xmp):
    photo(tmp_path / "a.JPG", 1.0, 2.0, xmp)
    (place,) = read_photos(str(tmp_path)).values()
    assert place == (48.123456789, -14.5, 40.1)


def test_photos_without_a_place_are_named_and_others_kept_in_order(tmp_path):
    photo(tmp_path / "b.jpg", 10.0, 20.0)
    photo(tmp_path / "a.jpg", 11.0, 20.0)
    photo(tmp_path / "c.jpg")
    photo(tmp_path / "d.jpg", 0.0, 0.0)
    (tmp_path / "e.jpg").write_bytes(b"\xff\xd8 no photo")
    (tmp_path / "f.jpg").write_bytes(b"")
    (tmp_path / "notes.txt").write_text("no photo")
    places = read_photos(str(tmp_path))
    assert list(places) == ["a.jpg", "b.jpg", "c.jpg", "d.jpg", "e.jpg", "f.jpg"]
    latitudes = [place.latitude for place in list(places.values())[:2]]
    assert latitudes == pytest.approx([11.0, 10.0])
    assert list(places.values())[2:] == [None] * 4


@pytest.mark.parametrize("gps", [{2: (1.0,)}, {2: "x"}, {4: (rational(400), 0, 0)}])
def test_damaged_positions_are_none(tmp_path, gps):
    photo(tmp_path / "a.jpg", 10.0, 20.0)
    try:
        photo(tmp_path / "b.jpg", 10.0, 20.0, gps=gps)
    except Exception:  # noqa: BLE001 (what cannot be written cannot be read either)
        return
    assert read_photos(str(tmp_path))["b.jpg"] is None


def test_no_folder_and_no_photo_are_errors(tmp_path):
    with pytest.raises(RequestError, match="no such file"):
        read_photos(str(tmp_path / "none"))
    with pytest.raises(RequestError, match="0 photos looked at"):
        read_photos(str(tmp_path))
