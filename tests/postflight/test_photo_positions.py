"""Positions of photos from EXIF and XMP as cameras write them, and from faulty metadata."""

import pytest
from support.geotagged import photo, rational

from aosplan.errors import RequestError
from aosplan.postflight import photo_positions
from aosplan.postflight.photo_positions import read_photos
from aosplan.postflight.views import read_views

Image = pytest.importorskip("PIL.Image")


@pytest.mark.parametrize(
    ("latitude", "longitude"), [(48.3358, 14.3261), (-33.5, -70.25), (0.0, 179.999), (-0.5, 0.0)]
)
def test_exif_positions_are_read(tmp_path, latitude, longitude):
    photo(tmp_path / "a.jpg", latitude, longitude)
    (place,) = read_photos(str(tmp_path)).places.values()
    assert place.altitude_m is None
    assert place.latitude == pytest.approx(latitude, abs=1e-7)
    assert place.longitude == pytest.approx(longitude, abs=1e-7)


@pytest.mark.parametrize("endian", ["<", ">"])
def test_exif_of_either_byte_order_reads_the_same(tmp_path, endian):
    image, exif = Image.new("L", (8, 6)), Image.Exif()
    exif.endian = endian
    exif[0x8825] = {1: "S", 2: tuple(map(rational, (33, 30, 36))), 3: "W", 4: (70.0, 15.0, 0.0)}
    image.save(tmp_path / "a.jpg", exif=exif)
    (place,) = read_photos(str(tmp_path)).places.values()
    assert (place.latitude, place.longitude) == pytest.approx((-33.51, -70.25), abs=1e-9)


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
    (place,) = read_photos(str(tmp_path)).places.values()
    assert place == (48.123456789, -14.5, 40.1)


def test_photos_without_a_place_are_named_and_others_kept_in_order(tmp_path):
    photo(tmp_path / "b.jpg", 10.0, 20.0)
    photo(tmp_path / "a.jpg", 11.0, 20.0)
    photo(tmp_path / "c.jpg")
    photo(tmp_path / "d.jpg", 0.0, 0.0)
    (tmp_path / "e.jpg").write_bytes(b"\xff\xd8 no photo")
    (tmp_path / "f.jpg").write_bytes(b"")
    (tmp_path / "notes.txt").write_text("no photo")
    places = read_photos(str(tmp_path)).places
    assert list(places) == ["a.jpg", "b.jpg", "c.jpg", "d.jpg", "e.jpg", "f.jpg"]
    latitudes = [place.latitude for place in list(places.values())[:2]]
    assert latitudes == pytest.approx([11.0, 10.0])
    assert list(places.values())[2:] == [None] * 4


@pytest.mark.parametrize("gps", [{2: (1.0,)}, {2: "x"}, {4: (rational(400), 0, 0)}])
def test_photos_with_damaged_positions_have_no_position(tmp_path, gps):
    photo(tmp_path / "a.jpg", 10.0, 20.0)
    try:
        photo(tmp_path / "b.jpg", 10.0, 20.0, gps=gps)
    except Exception:  # noqa: BLE001 (what cannot be written cannot be read either)
        return
    assert read_photos(str(tmp_path)).places["b.jpg"] is None


def test_a_missing_folder_and_a_folder_without_photos_are_errors(tmp_path):
    with pytest.raises(RequestError, match="no such file"):
        read_photos(str(tmp_path / "none"))
    with pytest.raises(RequestError, match="0 photos were read"):
        read_photos(str(tmp_path))


# Hemispheres and parts that are missing or contradict each other


def exif(tmp_path, gps, latitude=-33.5, longitude=-70.25):
    photo(tmp_path / "good.jpg", 1.0, 2.0)
    photo(tmp_path / "a.jpg", latitude, longitude, gps=gps)
    photos = read_photos(str(tmp_path))
    return photos.places["a.jpg"], photos.doubtful.get("a.jpg", "")


@pytest.mark.parametrize("letter", ["S", "s", "S\0", "South", b"S", b"S\0"])
def test_a_hemisphere_is_read_in_any_type(tmp_path, letter):
    place, _ = exif(tmp_path, {1: letter})
    assert place.latitude == pytest.approx(-33.5)


@pytest.mark.parametrize(
    ("gps", "said"),
    [
        ({1: ""}, "without its hemisphere"),
        ({1: "E"}, "without its hemisphere"),
        ({3: "?"}, "without its hemisphere"),
    ],
)
def test_a_position_without_its_hemisphere_is_not_guessed(tmp_path, gps, said):
    place, why = exif(tmp_path, gps)
    assert place is None
    assert said in why


@pytest.mark.parametrize(("reference", "letters"), [(1, "NS"), (3, "EW")])
def test_a_hemisphere_that_is_not_there_is_not_guessed(reference, letters):
    with pytest.raises(photo_positions.DoubtfulError, match="without its hemisphere"):
        photo_positions.degrees_of({reference + 1: (33.0, 51.0, 24.5)}, reference, letters)


def test_a_negative_angle_has_to_agree_with_its_hemisphere():
    assert photo_positions.degrees_of({1: "S", 2: (-33.0, 30.0, 0.0)}, 1, "NS") == -33.5
    with pytest.raises(photo_positions.DoubtfulError, match="contradict each other"):
        photo_positions.degrees_of({1: "N", 2: (-33.0, 30.0, 0.0)}, 1, "NS")


def test_seconds_of_0_over_0_are_ignored_if_minutes_have_decimals(tmp_path):
    from PIL.TiffImagePlugin import IFDRational

    nothing = IFDRational(0, 0)
    place, _ = exif(tmp_path, {2: (rational(33), rational("30.125"), nothing)})
    assert place.latitude == pytest.approx(-(33 + 30.125 / 60), abs=1e-7)
    place, why = exif(tmp_path, {2: (rational(33), rational(30), nothing)})
    assert place is None
    assert "seconds" in why


def test_zeros_in_xmp_are_not_a_position_even_if_exif_is_valid(tmp_path):
    xmp = b'<x drone-dji:GpsLatitude="+0.0" drone-dji:GpsLongitude="0.0" '
    photo(tmp_path / "a.jpg", -33.5, -70.25, xmp + b'drone-dji:RelativeAltitude="+40.1"/>')
    place = read_photos(str(tmp_path)).places["a.jpg"]
    assert place == pytest.approx((-33.5, -70.25, 40.1))


def test_xmp_on_the_other_hemisphere_than_exif_is_refused(tmp_path):
    photo(tmp_path / "good.jpg", 1.0, 2.0)
    xmp = b'<x drone-dji:GpsLatitude="33.5" drone-dji:GpsLongitude="-70.25"/>'
    photo(tmp_path / "a.jpg", -33.5, -70.25, xmp)
    photos = read_photos(str(tmp_path))
    assert photos.places["a.jpg"] is None
    assert "33.5 by its XMP, and at -33.5 by its EXIF" in photos.doubtful["a.jpg"]


def test_photos_that_are_all_doubtful_are_an_error_that_says_why(tmp_path):
    photo(tmp_path / "a.jpg", -33.5, -70.25, gps={1: ""})
    with pytest.raises(RequestError, match=r"a.jpg has a position without its hemisphere"):
        read_photos(str(tmp_path))


def test_thermal_and_visible_photos_of_a_shot_count_once_with_a_notice(tmp_path):
    for number in range(1, 4):
        for second, letter in enumerate("TVW"):
            name = f"DJI_202501011200{number}{second}_000{number}_{letter}.JPG"
            photo(tmp_path / name, 48.0 + 1e-3 * number, 14.0)
    # This is the first photo of another flight.
    photo(tmp_path / "DJI_20250101120050_0001_V.JPG", 48.01, 14.0)
    photos = read_photos(str(tmp_path))
    assert [name[-10:-4] for name in photos.places] == ["0001_T", "0002_T", "0003_T", "0001_V"]
    assert len(photos.paired) == 6
    codes = dict(read_views(str(tmp_path), on_earth=True).messages())
    assert codes["paired_photos"].startswith("6 photos")
