"""Presets of cameras that are used for airborne optical sectioning, and `find_camera`, which finds a
camera by the name of a preset or the path of a file.

Each preset is a pinhole model of a still image.  The field of view along the image width is ``2 *
atan(sensor_width_mm / (2 * focal_length_mm))``.  Manufacturers publish nominal fields of view of
the uncorrected image.  With barrel distortion, this field of view is slightly larger than that of
the pinhole model.  If the difference is more than about 2 %, ``assumed`` mentions it.  For such a
lens, the pinhole model underestimates the footprint, and the real overlap is larger than planned.

Fisheye modes (such as GoPro "wide") have no pinhole model and are not included.
"""

from __future__ import annotations

from typing import NamedTuple

from aosplan.camera.camera import Camera


class CameraPreset(NamedTuple):
    """A camera as its manufacturer specifies it; the image width is the longer side."""

    title: str
    """Name for output, for example "DJI Mavic 3T, thermal camera"."""
    band: str
    """"thermal", "colour" or "multispectral"."""
    focal_length_mm: float
    """Physical focal length [mm], calibrated if a calibration is published; not a 35 mm equivalent."""
    sensor_width_mm: float
    """Width of the part of the sensor that becomes the image."""
    sensor_height_mm: float
    """Height of the part of the sensor that becomes the image."""
    image_width_px: int
    image_height_px: int
    source: str
    """Where the numbers are published."""
    assumed: str = ""
    """Which numbers are derived or assumed, and how; empty if all numbers are published."""


CAMERAS: dict[str, CameraPreset] = {
    # DJI, thermal cameras
    "dji-m3t-thermal": CameraPreset(
        title="DJI Mavic 3T, thermal camera",
        band="thermal",
        focal_length_mm=9.1,
        sensor_width_mm=7.68,
        sensor_height_mm=6.144,
        image_width_px=640,
        image_height_px=512,
        source=(
            "Mavic 3 Enterprise Series specifications, DJI (40 mm equivalent, 61° diagonal); compare"
            " the calibration in s-du/IRMapper, cam_calib_m3t_opencv.xml (765 px, 9.2 mm)"
        ),
        assumed=(
            "sensor size computed from the pixel pitch of 12 µm; focal length computed from "
            "the 40 mm equivalent, which is also in the tags of the images; DJI also states "
            "61° diagonal (with lens distortion), but 9.1 mm gives 57°"
        ),
    ),
    "dji-m30t-thermal": CameraPreset(
        title="DJI Matrice 30T, thermal camera",
        band="thermal",
        focal_length_mm=9.1,
        sensor_width_mm=7.68,
        sensor_height_mm=6.144,
        image_width_px=640,
        image_height_px=512,
        source=(
            "Matrice 30 Series specifications, DJI; focal length confirmed by the calibration in"
            " s-du/Thermogram, cam_calib_m30t_opencv.xml (741 px, 8.9 mm)"
        ),
        assumed=(
            "sensor size computed from the pixel pitch of 12 µm; DJI also states 61° "
            "diagonal (with lens distortion), but 9.1 mm (40 mm equivalent) gives 57°"
        ),
    ),
    "dji-h20t-thermal": CameraPreset(
        title="DJI Zenmuse H20T, thermal camera",
        band="thermal",
        focal_length_mm=13.5,
        sensor_width_mm=7.68,
        sensor_height_mm=6.144,
        image_width_px=640,
        image_height_px=512,
        source="Zenmuse H20 Series specifications, DJI (13.5 mm, 40.6° diagonal)",
        assumed="sensor size computed from the pixel pitch of 12 µm",
    ),
    "dji-h30t-thermal": CameraPreset(
        title="DJI Zenmuse H30T, thermal camera",
        band="thermal",
        focal_length_mm=24.0,
        sensor_width_mm=15.36,
        sensor_height_mm=12.288,
        image_width_px=1280,
        image_height_px=1024,
        source=(
            "Zenmuse H30 Series specifications, DJI (52 mm equivalent, 45.2° diagonal); focal"
            " length confirmed by the calibration in s-du/Thermogram, cam_calib_h30t_opencv.xml"
            " (2015 px, 24.2 mm)"
        ),
        assumed="sensor size computed from the pixel pitch of 12 µm",
    ),
    "dji-m4t-thermal": CameraPreset(
        title="DJI Matrice 4T, thermal camera",
        band="thermal",
        focal_length_mm=12.0,
        sensor_width_mm=7.68,
        sensor_height_mm=6.144,
        image_width_px=640,
        image_height_px=512,
        source=(
            "Matrice 4 Series specifications, DJI (53 mm equivalent, 45° diagonal); compare the"
            " calibration in s-du/Thermogram, cam_calib_m4t_opencv.xml (12.1 mm)"
        ),
        assumed=(
            "sensor size computed from the pixel pitch of 12 µm; focal length computed from "
            "the 53 mm equivalent; native 640 x 512 image, not the enlarged 1280 x 1024 one"
        ),
    ),
    "dji-m3td-thermal": CameraPreset(
        title="DJI Matrice 3TD, thermal camera",
        band="thermal",
        focal_length_mm=9.1,
        sensor_width_mm=7.68,
        sensor_height_mm=6.144,
        image_width_px=640,
        image_height_px=512,
        source="Matrice 3D Series specifications, DJI (40 mm equivalent, 61° diagonal)",
        assumed=(
            "sensor size computed from the pixel pitch of 12 µm; focal length as for the "
            "Mavic 3T, for which DJI states the same 40 mm equivalent and 61° diagonal; 9.1 "
            "mm gives 57°; unconfirmed"
        ),
    ),
    "dji-m4td-thermal": CameraPreset(
        title="DJI Matrice 4TD, thermal camera",
        band="thermal",
        focal_length_mm=12.0,
        sensor_width_mm=7.68,
        sensor_height_mm=6.144,
        image_width_px=640,
        image_height_px=512,
        source="Matrice 4D Series specifications, DJI (53 mm equivalent, 45° diagonal)",
        assumed=(
            "sensor size computed from the pixel pitch of 12 µm; focal length as for the "
            "Matrice 4T, for which DJI states the same 53 mm equivalent and 45°; native 640 "
            "x 512 image; unconfirmed"
        ),
    ),
    "dji-m2ea-thermal": CameraPreset(
        title="DJI Mavic 2 Enterprise Advanced, thermal camera",
        band="thermal",
        focal_length_mm=9.0,
        sensor_width_mm=7.68,
        sensor_height_mm=6.144,
        image_width_px=640,
        image_height_px=512,
        source=(
            "Mavic 2 Enterprise Advanced specifications, DJI (about 9 mm); focal length confirmed"
            " by the calibration in s-du/IRMapper, cam_calib_m2t_opencv.xml (751 px, 9.0 mm; 9.12 mm in Theta-Limited/DroneModels)"
        ),
        assumed=(
            "sensor size computed from the pixel pitch of 12 µm; DJI states no field of view; the "
            "stated equivalent of about 38 mm would give 59° diagonal, but 9 mm gives 57°"
        ),
    ),
    "dji-xt2-640-13mm": CameraPreset(
        title="DJI Zenmuse XT2 640, 13 mm lens, thermal camera",
        band="thermal",
        focal_length_mm=13.0,
        sensor_width_mm=10.88,
        sensor_height_mm=8.704,
        image_width_px=640,
        image_height_px=512,
        source="Zenmuse XT2 specifications, DJI (13 mm, 45° x 37°)",
        assumed="sensor size computed from the pixel pitch of 17 µm; nominal data-sheet values",
    ),
    "dji-xt2-640-19mm": CameraPreset(
        title="DJI Zenmuse XT2 640, 19 mm lens, thermal camera",
        band="thermal",
        focal_length_mm=19.0,
        sensor_width_mm=10.88,
        sensor_height_mm=8.704,
        image_width_px=640,
        image_height_px=512,
        source="Zenmuse XT2 specifications, DJI (19 mm, 32° x 26°)",
        assumed="sensor size computed from the pixel pitch of 17 µm; nominal data-sheet values",
    ),
    # DJI, colour cameras
    "dji-m3t-wide": CameraPreset(
        title="DJI Mavic 3T, wide camera",
        band="colour",
        focal_length_mm=4.4,
        sensor_width_mm=6.4,
        sensor_height_mm=4.8,
        image_width_px=8000,
        image_height_px=6000,
        source=(
            "Mavic 3 Enterprise Series specifications, DJI (1/2-inch, 84°, 24 mm equivalent);"
            " compare the calibration in s-du/IRMapper, rgb_cam_calib_m3t_opencv.xml (2794 px at"
            " 4000 px image width)"
        ),
        assumed=(
            "sensor size is the nominal 1/2-inch area (0.8 µm pitch); focal length computed "
            "from the diagonal field of view of 84°, rounded to 0.1 mm"
        ),
    ),
    "dji-m3e-wide": CameraPreset(
        title="DJI Mavic 3E, wide camera",
        band="colour",
        focal_length_mm=12.29,
        sensor_width_mm=17.424,
        sensor_height_mm=13.0548,
        image_width_px=5280,
        image_height_px=3956,
        source=(
            "Mavic 3 Enterprise Series specifications, DJI (4/3, 3.3 µm pixels, 84°,"
            " 24 mm equivalent)"
        ),
        assumed=(
            "sensor size computed from the pixel pitch of 3.3 µm; focal length as in the "
            "tags of the images (12.29 mm, 3725 px), which gives 83°"
        ),
    ),
    "dji-m3m-wide": CameraPreset(
        title="DJI Mavic 3M, colour camera",
        band="colour",
        focal_length_mm=12.29,
        sensor_width_mm=17.424,
        sensor_height_mm=13.0548,
        image_width_px=5280,
        image_height_px=3956,
        source="Mavic 3M specifications, DJI (4/3, 84°, 24 mm equivalent)",
        assumed=(
            "sensor size computed from the pixel pitch of 3.3 µm; focal length as in the "
            "tags of images of the Mavic 3E (12.29 mm), for which DJI states the same 4/3 "
            "sensor, 84° and 24 mm equivalent; it gives 83°"
        ),
    ),
    "dji-m3d-wide": CameraPreset(
        title="DJI Matrice 3D, wide camera",
        band="colour",
        focal_length_mm=12.29,
        sensor_width_mm=17.424,
        sensor_height_mm=13.0548,
        image_width_px=5280,
        image_height_px=3956,
        source="Matrice 3D Series specifications, DJI (4/3, 84°, 24 mm equivalent)",
        assumed=(
            "sensor size computed from the pixel pitch of 3.3 µm; focal length as in the "
            "tags of images of the Mavic 3E (12.29 mm), for which DJI states the same 4/3 "
            "sensor, 84° and 24 mm equivalent; it gives 83°; unconfirmed"
        ),
    ),
    "dji-m4d-wide": CameraPreset(
        title="DJI Matrice 4D, wide camera",
        band="colour",
        focal_length_mm=12.29,
        sensor_width_mm=17.424,
        sensor_height_mm=13.0548,
        image_width_px=5280,
        image_height_px=3956,
        source="Matrice 4D Series specifications, DJI (4/3, 84°, 24 mm equivalent)",
        assumed=(
            "sensor size computed from the pixel pitch of 3.3 µm; focal length as in the "
            "tags of images of the Mavic 3E (12.29 mm), for which DJI states the same 4/3 "
            "sensor, 84° and 24 mm equivalent; it gives 83°; unconfirmed"
        ),
    ),
    "dji-m3m-multispectral": CameraPreset(
        title="DJI Mavic 3M, one band of its multispectral camera",
        band="multispectral",
        focal_length_mm=4.34,
        sensor_width_mm=5.184,
        sensor_height_mm=3.888,
        image_width_px=2592,
        image_height_px=1944,
        source="Mavic 3M specifications, DJI (1/2.8-inch, 73.91° diagonal, 61.2° x 48.1°, 25 mm equivalent)",
        assumed=(
            "sensor size computed from the pixel pitch of 2 µm, the usual one for 5 "
            "megapixels at 1/2.8 inch; focal length between those of the three stated "
            "angles; unconfirmed"
        ),
    ),
    "dji-m30t-wide": CameraPreset(
        title="DJI Matrice 30T, wide camera",
        band="colour",
        focal_length_mm=4.5,
        sensor_width_mm=6.4,
        sensor_height_mm=4.8,
        image_width_px=4000,
        image_height_px=3000,
        source=(
            "Matrice 30 Series specifications, DJI (1/2-inch, 4.5 mm, 84° diagonal); compare the"
            " calibration in s-du/Thermogram, rgb_cam_calib_m30t_opencv.xml (2863 px)"
        ),
        assumed="sensor size is the nominal 1/2-inch area",
    ),
    "dji-h20t-wide": CameraPreset(
        title="DJI Zenmuse H20T, wide camera",
        band="colour",
        focal_length_mm=4.3,
        sensor_width_mm=6.2868,
        sensor_height_mm=4.712,
        image_width_px=4056,
        image_height_px=3040,
        source=(
            "Zenmuse H20 Series specifications, DJI (1/2.3-inch, 4.5 mm, 82.9° diagonal); focal length:"
            " calibration in Theta-Limited/DroneModels, droneModels.json (2775 px)"
        ),
        assumed=(
            "sensor size computed from the pixel pitch of 1.55 µm, the usual one for 12 "
            "megapixels at 1/2.3 inch; the calibrated lens is 4 % wider than the nominal 4.5 "
            "mm and gives 85°, but DJI states 82.9°"
        ),
    ),
    "dji-h30t-wide": CameraPreset(
        title="DJI Zenmuse H30T, wide camera",
        band="colour",
        focal_length_mm=6.72,
        sensor_width_mm=9.6,
        sensor_height_mm=7.2,
        image_width_px=8064,
        image_height_px=6048,
        source=(
            "Zenmuse H30 Series specifications, DJI (1/1.3-inch, 24 mm equivalent, 82.1°"
            " diagonal); compare the calibration in s-du/Thermogram,"
            " rgb_cam_calib_h30t_opencv.xml (2797 px at 4032 px image width)"
        ),
        assumed=(
            "sensor size is the nominal 1/1.3-inch area; 6.72 mm is the nominal data-sheet value"
        ),
    ),
    "dji-m4t-wide": CameraPreset(
        title="DJI Matrice 4T, wide camera",
        band="colour",
        focal_length_mm=6.72,
        sensor_width_mm=9.6,
        sensor_height_mm=7.2,
        image_width_px=8064,
        image_height_px=6048,
        source="Matrice 4 Series specifications, DJI (1/1.3-inch, 82°, 24 mm equivalent)",
        assumed=(
            "sensor size is the nominal 1/1.3-inch area; focal length computed from the 24 "
            "mm equivalent and 82°, assumed to be that of the Zenmuse H30T wide camera"
        ),
    ),
    "dji-m4e-wide": CameraPreset(
        title="DJI Matrice 4E, wide camera",
        band="colour",
        focal_length_mm=12.29,
        sensor_width_mm=17.424,
        sensor_height_mm=13.0548,
        image_width_px=5280,
        image_height_px=3956,
        source="Matrice 4 Series specifications, DJI (4/3, 84°, 24 mm equivalent)",
        assumed=(
            "focal length (12.29 mm) and pixel pitch (3.3 µm) computed from the tags of the "
            "images (12.29 mm, 3725 px); they give 83°"
        ),
    ),
    "dji-mini-2": CameraPreset(
        title="DJI Mini 2",
        band="colour",
        focal_length_mm=4.36,
        sensor_width_mm=6.17,
        sensor_height_mm=4.63,
        image_width_px=4000,
        image_height_px=3000,
        source="Mini 2 specifications, DJI (1/2.3-inch, 83°, 24 mm equivalent)",
        assumed=(
            "sensor size is the nominal 1/2.3-inch area; focal length computed from the "
            "diagonal field of view of 83°"
        ),
    ),
    "dji-mini-3-pro": CameraPreset(
        title="DJI Mini 3 Pro, 12 megapixels",
        band="colour",
        focal_length_mm=6.7,
        sensor_width_mm=9.6,
        sensor_height_mm=7.2,
        image_width_px=4032,
        image_height_px=3024,
        source=(
            "Mini 3 Pro specifications, DJI (1/1.3-inch, 82.1°, 24 mm equivalent); focal length: calibration"
            " in Theta-Limited/DroneModels, droneModels.json (2814 px, FC3582)"
        ),
        assumed=(
            "sensor size is the nominal 1/1.3-inch area; the 12-megapixel mode is assumed, "
            "because images of 48 megapixels take longer to store"
        ),
    ),
    "dji-mini-4-pro": CameraPreset(
        title="DJI Mini 4 Pro, 12 megapixels",
        band="colour",
        focal_length_mm=7.19,
        sensor_width_mm=9.6,
        sensor_height_mm=7.2,
        image_width_px=4032,
        image_height_px=3024,
        source=(
            "Mini 4 Pro specifications, DJI (1/1.3-inch, 82.1°, 24 mm equivalent); focal length: calibration"
            " in Theta-Limited/DroneModels, droneModels.json (3019 px, FC8482)"
        ),
        assumed=(
            "sensor size is the nominal 1/1.3-inch area; the calibrated lens is 7 % narrower "
            "than the 82.1° that DJI states; the 12-megapixel mode is assumed, because "
            "images of 48 megapixels take longer to store"
        ),
    ),
    "dji-mini-5-pro": CameraPreset(
        title="DJI Mini 5 Pro, 12 megapixels",
        band="colour",
        focal_length_mm=9.1,
        sensor_width_mm=13.1072,
        sensor_height_mm=9.8304,
        image_width_px=4096,
        image_height_px=3072,
        source="Mini 5 Pro specifications, DJI (1-inch, 84°, 24 mm equivalent)",
        assumed=(
            "sensor size computed from the pixel pitch of 3.2 µm of the 12-megapixel image, "
            "the usual one at 1 inch; focal length computed from the diagonal field of view "
            "of 84°; unconfirmed"
        ),
    ),
    "dji-air-2s": CameraPreset(
        title="DJI Air 2S",
        band="colour",
        focal_length_mm=8.2,
        sensor_width_mm=13.1328,
        sensor_height_mm=8.7552,
        image_width_px=5472,
        image_height_px=3648,
        source="Air 2S specifications, DJI (1-inch, 2.4 µm pixels, 88°, 22 mm equivalent)",
        assumed=(
            "sensor size computed from the pixel pitch of 2.4 µm; focal length computed from "
            "the diagonal field of view of 88°, rounded to 0.1 mm"
        ),
    ),
    "dji-air-3-wide": CameraPreset(
        title="DJI Air 3, wide camera, 12 megapixels",
        band="colour",
        focal_length_mm=6.72,
        sensor_width_mm=9.6,
        sensor_height_mm=7.2,
        image_width_px=4032,
        image_height_px=3024,
        source="Air 3 specifications, DJI (1/1.3-inch, 82°, 24 mm equivalent)",
        assumed=(
            "nominal data-sheet values; sensor size is the nominal 1/1.3-inch area; focal "
            "length computed from the 24 mm equivalent and 82°, assumed to be that of the "
            "Zenmuse H30T wide camera; the 12-megapixel mode is assumed, because images of "
            "48 megapixels take longer to store"
        ),
    ),
    "dji-air-3s-wide": CameraPreset(
        title="DJI Air 3S, wide camera, 12 megapixels",
        band="colour",
        focal_length_mm=9.1,
        sensor_width_mm=13.1072,
        sensor_height_mm=9.8304,
        image_width_px=4096,
        image_height_px=3072,
        source="Air 3S specifications, DJI (1-inch, 84°, 24 mm equivalent)",
        assumed=(
            "sensor size computed from the pixel pitch of 3.2 µm of the 12-megapixel image, "
            "the usual one at 1 inch; focal length computed from the diagonal field of view "
            "of 84°; unconfirmed"
        ),
    ),
    "dji-mavic-3-wide": CameraPreset(
        title="DJI Mavic 3, main camera",
        band="colour",
        focal_length_mm=12.8,
        sensor_width_mm=17.424,
        sensor_height_mm=13.0548,
        image_width_px=5280,
        image_height_px=3956,
        source=(
            "Mavic 3 specifications, DJI (4/3, 84°, 24 mm equivalent); focal length: calibration in"
            " Theta-Limited/DroneModels, droneModels.json (3880 px, L2D-20c)"
        ),
        assumed=(
            "sensor size computed from the pixel pitch of 3.3 µm, as for the Mavic 3E; the "
            "calibrated lens is 4 % narrower than the 12.29 mm in the tags of images of the "
            "Mavic 3E"
        ),
    ),
    "dji-mavic-4-pro-wide": CameraPreset(
        title="DJI Mavic 4 Pro, main camera, 25 megapixels",
        band="colour",
        focal_length_mm=14.3,
        sensor_width_mm=17.3,
        sensor_height_mm=11.5333,
        image_width_px=6144,
        image_height_px=4096,
        source="Mavic 4 Pro specifications, DJI (4/3, 72°, 28 mm equivalent)",
        assumed=(
            "sensor width of a 4/3 sensor; 25 megapixels with an aspect ratio of 3:2; focal "
            "length computed from "
            "the diagonal field of view of 72°; all unconfirmed"
        ),
    ),
    "dji-mavic-2-pro": CameraPreset(
        title="DJI Mavic 2 Pro",
        band="colour",
        focal_length_mm=10.51,
        sensor_width_mm=13.1328,
        sensor_height_mm=8.7552,
        image_width_px=5472,
        image_height_px=3648,
        source=(
            "Mavic 2 Pro specifications, DJI (1-inch, 77°, 28 mm equivalent); focal length: calibration in"
            " Theta-Limited/DroneModels, droneModels.json (4378 px, L1D-20c)"
        ),
        assumed=(
            "sensor size computed from the pixel pitch of 2.4 µm, as for the Phantom 4 Pro; "
            "the calibrated lens is 2 % narrower than the 10.26 mm in the tags of the "
            "images, and gives 74°"
        ),
    ),
    "dji-phantom-4-pro": CameraPreset(
        title="DJI Phantom 4 Pro",
        band="colour",
        focal_length_mm=8.8,
        sensor_width_mm=13.1328,
        sensor_height_mm=8.7552,
        image_width_px=5472,
        image_height_px=3648,
        source=(
            "Phantom 4 Pro specifications, DJI (1-inch, 8.8 mm, 84°, 24 mm equivalent); the "
            "tags of the images contain 3666.67 px"
        ),
        assumed="sensor size computed from the pixel pitch of 2.4 µm, which the recorded focal "
        "length in pixels implies",
    ),
    "dji-p1-35mm": CameraPreset(
        title="DJI Zenmuse P1, 35 mm lens",
        band="colour",
        focal_length_mm=36.08,
        sensor_width_mm=35.9,
        sensor_height_mm=24.0,
        image_width_px=8192,
        image_height_px=5460,
        source=(
            "Zenmuse P1 specifications, DJI (35.9 x 24 mm, 63.5° diagonal with 35 mm); focal length:"
            " calibration in Theta-Limited/DroneModels, droneModels.json (8233 px)"
        ),
        assumed=(
            "nominal sensor size; the calibrated lens is 3 % narrower than the nominal 35 mm "
            "and gives 62°, but DJI states 63.5°"
        ),
    ),
    # FLIR
    "flir-vue-pro-640-9mm": CameraPreset(
        title="FLIR Vue Pro 640, 9 mm lens",
        band="thermal",
        focal_length_mm=9.0,
        sensor_width_mm=10.88,
        sensor_height_mm=8.704,
        image_width_px=640,
        image_height_px=512,
        source=(
            "Vue Pro data sheet, FLIR Systems; focal length confirmed by the calibration in"
            " JKU-ICG/AOS, CAM/Undistort.py (534 px, 9.07 mm)"
        ),
        assumed=(
            "sensor size computed from the pixel pitch of 17 µm; FLIR states 69° x 56° (with "
            "lens distortion), but 9 mm gives 62° x 52°"
        ),
    ),
    "flir-vue-pro-640-13mm": CameraPreset(
        title="FLIR Vue Pro 640, 13 mm lens",
        band="thermal",
        focal_length_mm=13.0,
        sensor_width_mm=10.88,
        sensor_height_mm=8.704,
        image_width_px=640,
        image_height_px=512,
        source="Vue Pro data sheet, FLIR Systems (13 mm, 45° x 37°)",
        assumed="sensor size computed from the pixel pitch of 17 µm",
    ),
    "flir-vue-pro-640-19mm": CameraPreset(
        title="FLIR Vue Pro 640, 19 mm lens",
        band="thermal",
        focal_length_mm=19.0,
        sensor_width_mm=10.88,
        sensor_height_mm=8.704,
        image_width_px=640,
        image_height_px=512,
        source="Vue Pro data sheet, FLIR Systems (19 mm, 32° x 26°)",
        assumed="sensor size computed from the pixel pitch of 17 µm",
    ),
    "flir-vue-pro-r-336-9mm": CameraPreset(
        title="FLIR Vue Pro R 336, 9 mm lens",
        band="thermal",
        focal_length_mm=9.0,
        sensor_width_mm=5.712,
        sensor_height_mm=4.352,
        image_width_px=336,
        image_height_px=256,
        source="Vue Pro R data sheet, FLIR Systems (9 mm, 35° x 27°)",
        assumed="sensor size computed from the pixel pitch of 17 µm; nominal data-sheet values",
    ),
    "flir-vue-pro-r-336-13mm": CameraPreset(
        title="FLIR Vue Pro R 336, 13 mm lens",
        band="thermal",
        focal_length_mm=13.0,
        sensor_width_mm=5.712,
        sensor_height_mm=4.352,
        image_width_px=336,
        image_height_px=256,
        source="Vue Pro R data sheet, FLIR Systems (13 mm, 25° x 19°)",
        assumed="sensor size computed from the pixel pitch of 17 µm; nominal data-sheet values",
    ),
    "flir-tau-2-640-13mm": CameraPreset(
        title="FLIR Tau 2 640, 13 mm lens",
        band="thermal",
        focal_length_mm=13.0,
        sensor_width_mm=10.88,
        sensor_height_mm=8.704,
        image_width_px=640,
        image_height_px=512,
        source="Tau 2 data sheet, FLIR Systems (13 mm, 45° x 37°)",
        assumed="sensor size computed from the pixel pitch of 17 µm; nominal data-sheet values",
    ),
    "flir-tau-2-640-19mm": CameraPreset(
        title="FLIR Tau 2 640, 19 mm lens",
        band="thermal",
        focal_length_mm=19.0,
        sensor_width_mm=10.88,
        sensor_height_mm=8.704,
        image_width_px=640,
        image_height_px=512,
        source="Tau 2 data sheet, FLIR Systems (19 mm, 32° x 26°)",
        assumed="sensor size computed from the pixel pitch of 17 µm; nominal data-sheet values",
    ),
    "flir-tau-2-640-25mm": CameraPreset(
        title="FLIR Tau 2 640, 25 mm lens",
        band="thermal",
        focal_length_mm=25.0,
        sensor_width_mm=10.88,
        sensor_height_mm=8.704,
        image_width_px=640,
        image_height_px=512,
        source="Tau 2 data sheet, FLIR Systems (25 mm, 25° x 20°)",
        assumed="sensor size computed from the pixel pitch of 17 µm; nominal data-sheet values",
    ),
    "flir-boson-640-13-6mm": CameraPreset(
        title="FLIR Boson 640, 13.6 mm lens",
        band="thermal",
        focal_length_mm=13.6,
        sensor_width_mm=7.68,
        sensor_height_mm=6.144,
        image_width_px=640,
        image_height_px=512,
        source=(
            "Boson Thermal Imaging Core datasheet, 102-2013-40, FLIR Systems (32° horizontal);"
            " focal length as in Theta-Limited/DroneModels, droneModels.json (Boson 640, 13.6 mm)"
        ),
        assumed="sensor size computed from the pixel pitch of 12 µm; 32° is the nominal data-sheet "
        "value",
    ),
    "flir-boson-640-18mm": CameraPreset(
        title="FLIR Boson 640, 18 mm lens",
        band="thermal",
        focal_length_mm=18.0,
        sensor_width_mm=7.68,
        sensor_height_mm=6.144,
        image_width_px=640,
        image_height_px=512,
        source=(
            "Boson Thermal Imaging Core datasheet, 102-2013-40, FLIR Systems"
            " (18 mm, 24° horizontal)"
        ),
        assumed="sensor size computed from the pixel pitch of 12 µm; nominal data-sheet values",
    ),
    "flir-boson-640-24mm": CameraPreset(
        title="FLIR Boson 640, 24 mm lens",
        band="thermal",
        focal_length_mm=24.0,
        sensor_width_mm=7.68,
        sensor_height_mm=6.144,
        image_width_px=640,
        image_height_px=512,
        source=(
            "Boson Thermal Imaging Core datasheet, 102-2013-40, FLIR Systems"
            " (24 mm, 18° horizontal)"
        ),
        assumed="sensor size computed from the pixel pitch of 12 µm; nominal data-sheet values",
    ),
    # The AOS project's own cameras
    "aos-vue-pro-9mm": CameraPreset(
        title="AOS project, FLIR Vue Pro 9 mm, recorded on board, rectified to 512 x 512",
        band="thermal",
        focal_length_mm=9.0,
        sensor_width_mm=8.55,
        sensor_height_mm=8.55,
        image_width_px=512,
        image_height_px=512,
        source="JKU-ICG/AOS, README.md (payload version 1) and CAM/Undistort.py (50.8°)",
        assumed="sensor area from the rectified 50.815° field of view and the nominal 9 mm",
    ),
    "aos-vue-pro-9mm-video": CameraPreset(
        title="AOS project, FLIR Vue Pro 9 mm, grabbed from the video signal, rectified to 512 x 512",
        band="thermal",
        focal_length_mm=9.0,
        sensor_width_mm=7.11,
        sensor_height_mm=7.11,
        image_width_px=512,
        image_height_px=512,
        source="JKU-ICG/AOS, README.md (payload version 3) and CAM/Undistort.py (43.1°)",
        assumed="sensor area from the rectified 43.108° field of view and the nominal 9 mm",
    ),
    "sony-a6000-16mm": CameraPreset(
        title="Sony Alpha 6000 at 16 mm (AOS project, payload version 1)",
        band="colour",
        focal_length_mm=16.0,
        sensor_width_mm=23.5,
        sensor_height_mm=15.6,
        image_width_px=6000,
        image_height_px=4000,
        source=(
            "Alpha 6000 (ILCE-6000) and E PZ 16-50 mm specifications, Sony (83° diagonal at"
            " 16 mm); JKU-ICG/AOS, README.md (camera and 16 mm to 50 mm lens)"
        ),
        assumed="lens at its widest, 16 mm",
    ),
    # Other cameras carried by drones
    "sony-a7r-ii-35mm": CameraPreset(
        title="Sony Alpha 7R II, 35 mm lens",
        band="colour",
        focal_length_mm=35.0,
        sensor_width_mm=35.9,
        sensor_height_mm=24.0,
        image_width_px=7952,
        image_height_px=5304,
        source="Alpha 7R II (ILCE-7RM2) specifications, Sony (35 mm lenses: 63° diagonal)",
        assumed="35 mm lens; nominal data-sheet values",
    ),
    "sony-a7r-iv-35mm": CameraPreset(
        title="Sony Alpha 7R IV, 35 mm lens",
        band="colour",
        focal_length_mm=35.0,
        sensor_width_mm=35.7,
        sensor_height_mm=23.8,
        image_width_px=9504,
        image_height_px=6336,
        source="Alpha 7R IV (ILCE-7RM4) specifications, Sony (35 mm lenses: 63° diagonal)",
        assumed="35 mm lens; nominal data-sheet values",
    ),
    "sony-rx1r-ii": CameraPreset(
        title="Sony RX1R II",
        band="colour",
        focal_length_mm=35.0,
        sensor_width_mm=35.9,
        sensor_height_mm=24.0,
        image_width_px=7952,
        image_height_px=5304,
        source="Cyber-shot DSC-RX1RM2 specifications, Sony (35 mm, 63° diagonal)",
        assumed="nominal data-sheet values",
    ),
    "gopro-hero8-linear": CameraPreset(
        title="GoPro HERO8 Black, linear",
        band="colour",
        focal_length_mm=3.39,
        sensor_width_mm=6.17,
        sensor_height_mm=4.63,
        image_width_px=4000,
        image_height_px=3000,
        source="HERO8 Black digital lenses, GoPro (linear: 19 mm to 39 mm equivalent)",
        assumed=(
            "sensor size is the nominal 1/2.3-inch area; focal length computed from the 19 "
            "mm equivalent along the diagonal, for the corrected 4:3 photo at its widest"
        ),
    ),
    "parrot-anafi-usa-thermal": CameraPreset(
        title="Parrot ANAFI USA, thermal camera",
        band="thermal",
        focal_length_mm=4.3,
        sensor_width_mm=3.84,
        sensor_height_mm=3.072,
        image_width_px=320,
        image_height_px=256,
        source=(
            "ANAFI USA specifications, Parrot (FLIR Boson 320); focal length and sensor size as in"
            " Theta-Limited/DroneModels, droneModels.json"
        ),
        assumed="sensor size computed from the pixel pitch of 12 µm; nominal data-sheet values",
    ),
    "parrot-anafi-thermal": CameraPreset(
        title="Parrot Anafi Thermal, thermal camera",
        band="thermal",
        focal_length_mm=1.77,
        sensor_width_mm=1.92,
        sensor_height_mm=1.44,
        image_width_px=160,
        image_height_px=120,
        source=(
            "Anafi Thermal specifications, Parrot (FLIR Lepton 3.5); Lepton 3.5 data sheet,"
            " FLIR Systems (57° horizontal)"
        ),
        assumed=(
            "sensor size computed from the pixel pitch of 12 µm; focal length computed from "
            "the horizontal field of view of 57°; 160 x 120 is the thermal data, not the "
            "enlarged photo; nominal data-sheet values; Theta-Limited/DroneModels has other "
            "values, those of the ANAFI USA (Boson 320, 4.3 mm)"
        ),
    ),
    "autel-evo-2-dual-640t-thermal": CameraPreset(
        title="Autel EVO II Dual 640T, thermal camera",
        band="thermal",
        focal_length_mm=13.0,
        sensor_width_mm=7.68,
        sensor_height_mm=6.144,
        image_width_px=640,
        image_height_px=512,
        source=(
            "EVO II Dual 640T specifications, Autel Robotics (13 mm, 33° x 26°); focal length and"
            " sensor size as in Theta-Limited/DroneModels, droneModels.json (XT709)"
        ),
        assumed="sensor size computed from the pixel pitch of 12 µm; field of view is the nominal "
        "data-sheet value",
    ),
    "autel-evo-max-4t-thermal": CameraPreset(
        title="Autel EVO Max 4T, thermal camera",
        band="thermal",
        focal_length_mm=13.0,
        sensor_width_mm=7.68,
        sensor_height_mm=6.144,
        image_width_px=640,
        image_height_px=512,
        source="EVO Max 4T specifications, Autel Robotics (13 mm, 42° diagonal)",
        assumed="sensor size computed from the pixel pitch of 12 µm; nominal data-sheet values",
    ),
    "autel-evo-max-4t-wide": CameraPreset(
        title="Autel EVO Max 4T, wide camera",
        band="colour",
        focal_length_mm=6.8,
        sensor_width_mm=9.994,
        sensor_height_mm=7.496,
        image_width_px=8192,
        image_height_px=6144,
        source="EVO Max 4T specifications, Autel Robotics (1/1.28-inch, 85° diagonal)",
        assumed=(
            "sensor size computed from the pixel pitch of 1.22 µm, the usual one for 50 "
            "megapixels at 1/1.28 inch; focal length computed from the diagonal field of "
            "view of 85°; nominal data-sheet values"
        ),
    ),
}


def find_camera(name: str, folder: str = "") -> Camera:
    """A camera from a preset, a file, or another installed distribution (``aosplan.cameras``).

    A file is looked for in `folder` first.

    Raises
    ------
    RequestError
        If no preset or file has this name.  The hint gives the most similar preset.
    """
    preset = CAMERAS.get(name)
    if preset is None:
        from aosplan.files import is_file_name, located
        from aosplan.plugins import added_preset

        if is_file_name(name):
            from aosplan.camera.camera_file import read_camera

            return read_camera(located(name, folder))
        preset = added_preset("camera", name, CAMERAS)
    return Camera(
        name=name,
        focal_length_mm=preset.focal_length_mm,
        sensor_width_mm=preset.sensor_width_mm,
        sensor_height_mm=preset.sensor_height_mm,
        image_width_px=preset.image_width_px,
        image_height_px=preset.image_height_px,
        title=preset.title,
        source=preset.source,
        assumed=preset.assumed,
    )
