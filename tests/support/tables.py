"""Cameras and scenes as tables and as files."""

import json

import pytest

from aosplan.cli.app import run
from aosplan.errors import RequestError
from aosplan.scenes.files.toml_file import read_scene_file

CAMERA = {
    "name": "own",
    "focal_length_mm": 9.1,
    "sensor_width_mm": 7.68,
    "sensor_height_mm": 6.144,
    "image_width_px": 640,
    "image_height_px": 512,
}
UNIFORM = {
    "name": "stand",
    "density": 0.0095,
    "occluder_size_m": 0.2,
    "volume_base_m": 2.5,
    "volume_height_m": 17.5,
}
LAYER = {"bottom_m": 2.0, "top_m": 2.5, "density": 0.1, "occluder_size_m": 0.2}
LAYERED = {"name": "stand", "layers": [LAYER, LAYER | {"bottom_m": 3.0, "top_m": 3.5}]}


def read_scene(path):
    return read_scene_file(path).scene


def refusal(read, path):
    with pytest.raises(RequestError) as caught:
        read(path)
    return caught.value


def printed(capsys, *arguments):
    assert run([*arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)
