"""Bad input gives one `error:` line, a `hint:` if there is a remedy, and no files."""

import re
import shlex
import subprocess
import sys

import pytest
from support.command_line import check_refusal, loads

BAD = """
plan
plan --altitude
plan --altitude 0
plan --altitude -5
plan --altitude nan
plan --altitude inf
plan --altitude 1e400
plan --altitude forty
plan --altitude 131parsecs
plan --altitude ''
plan --altitude 1_000
plan --altitude 20
plan --altitude 40 --gsd 0.05
plan --altitude 40 --target-size 1.8
plan --altitude 40 --focal-height -1
plan --gsd 0.001
plan --target-size 1.8
plan --target-pixels 20
plan --altitude 40 --vhat 98
plan --altitude 40 --vhat 1
plan --altitude 40 --vhat 100%
plan --altitude 40 --vhat -0.1
plan --altitude 40 --vhat nan
plan --altitude 40 --vhat 0,98
plan --altitude 40 --vhat ''
plan --altitude 40 --vhat 0.9999999
plan --altitude 40 --vhat 0.98 --visibility 0.6
plan --altitude 40 --visibility 0.68
plan --altitude 40 --visibility 60
plan --altitude 40 --scene paper-forrest
plan --altitude 40 --scene missing.toml
plan --altitude 40 --scene missing.laz
plan --altitude 40 --scene .
plan --altitude 40 --scene ''
plan --altitude 40 --density 0.01
plan --altitude 40 --density 0.01 --occluder-size 0.2
plan --altitude 40 --density 1.5 --occluder-size 0.2 --volume-height 18
plan --altitude 40 --density 1 --occluder-size 0.2 --volume-height 18
plan --altitude 40 --integrated-density 57 --occluder-size 0.2 --volume-height 18
plan --altitude 40 --density 0.01 --occluder-size 0.2 --volume-height 18 --volume-base 30
plan --altitude 40 --density 0.01 --occluder-size 0.2 --volume-height 9 --volume-base 0 --coverage 1
plan --altitude 40 --scene savanna --density 0.1
plan --altitude 40 --occluder-size 0.3
plan --altitude 40 --camera dji-m3
plan --altitude 40 --camera missing.json
plan --altitude 40 --focal-length 9
plan --altitude 40 --fov 60
plan --altitude 40 --fov 180 --image-width 640 --image-height 512
plan --altitude 40 --fov 60 --image-width 640.5 --image-height 512
plan --altitude 40 --coverage 0
plan --altitude 40 --coverage 2
plan --altitude 40 --model fancy
plan --altitude 40 --optimize money
plan --altitude 40 --max-aperture 5
plan --altitude 40 --max-samples 20
plan --altitude 40 --max-samples 20 --optimize aperture
plan --altitude 40 --baseline 0
plan --altitude 40 --baseline 0.0001
plan --altitude 40 --baseline 1 --max-samples 50
plan --altitude 40 --baseline 2 --max-aperture 5
plan --altitude 40 --samples 49
plan --altitude 40 --samples 0
plan --altitude 40 --samples 50.5
plan --altitude 40 --samples 10000000
plan --altitude 40 --samples 60 --max-samples 50
plan --altitude 40 --grid circle
plan --altitude 40 --lanes 3
plan --altitude 40 --grid spiral --lanes 3
plan --altitude 40 --grid spiral --lane-pitch 1.5
plan --altitude 40 --grid spiral --trigger distance
plan --altitude 40 --heading worst
tradeoff --altitude 40 --out table.txt
tradeoff --altitude 40 --density 0 --occluder-size 0.2 --volume-height 9
tradeoff --altitude 40 --vhat 0.98 --max-samples 20
plan --altitude 40 --grid lanes --lane-pitch 0.5
plan --altitude 40 --origin 48
plan --altitude 40 --origin 120,14
plan --altitude 40 --origin 14,200
plan --altitude 40 --origin x,y
plan --altitude 40 --heading north
plan --altitude 40 --speed 0
plan --altitude 40 --acceleration 0
plan --altitude 40 --hold -1
plan --altitude 40 --drone dji-m3
plan --altitude 40 --drone ''
plan --altitude 40 --climb 0
plan --altitude 40 --trigger time
plan --altitude 40 --max-blur 1
plan --altitude 40 --exposure-time 0.01
plan --altitude 40 --trigger distance --max-blur 0
plan --altitude 40 --trigger distance --acceleration 1e-9
plan --altitude 40 --trigger distance --exposure-time 5m
plan --altitude 40 --trigger distance --photo-interval -1
plan --altitude 40 --wind-speed 5
plan --altitude 40 --wind-from 90
plan --altitude 40 --wind-speed 3 --wind-from best
plan --altitude 40 --wind-speed 15 --wind-from 0
plan --altitude 40 --wind-speed 99 --wind-from 45 --trigger distance
plan --altitude 40 --wind-speed 5 --wind-from 0 --airspeed 4
plan --altitude 40 --takeoff 48,14
plan --altitude 40 --origin 48,14 --takeoff 48
plan --altitude 40 --origin 48,14 --takeoff=-48,14
plan --altitude 40 --origin 48,14 --takeoff 50,14 --flight-time 30
plan --altitude 40 --flight-time 0
plan --altitude 40 --flight-time 0.1
plan --altitude 40 --trigger distance --flight-time 0.7
plan --altitude 40 --resume-at 50
plan --altitude 40 --resume-at -1
plan --altitude 40 --resume-at 1.5
plan --altitude 40 --clearance -1
plan --altitude 40 --clearance 20
plan --altitude 40 --terrain dem.tif
plan --altitude 40 --terrain-tolerance 1
plan --altitude 40 --origin 48,14 --terrain missing.tif
plan --altitude 40 --origin 48,14 --terrain .
plan --altitude 40 --origin 48,14 --terrain /vsicurl/https://localhost/dem.tif
plan --altitude 40 --defaults missing.toml
plan --altitude 40 --defaults ''
drones extra
plan --altitude 40 --out plan.geojson
plan --altitude 40 --out plan.txt
plan --altitude 40 --out plan
plan --altitude 40 --out nofolder/plan.csv
plan --altitude 40 --out .
plan --altitude 40 --out -
plan --altitude 40 --out csv:
plan --altitude 40 --out ''
plan --altitude 40 --out a.csv --out a.csv
plan --altitude 40 --out a.csv --out ./a.csv
plan --altitude 40 --out csv:- --json
plan --altitude 40 --format csv
plan --altitude 40 --format cvs --out a.txt
plan --altitude 40 --format csv --out a.txt --out b.txt
plan --altitude 40 --bogus
plan --altitude 40 extra.toml more.toml
plan missing.toml
plan .
plan --altitude 40 --quiet=yes
plna
--bogus
--json
visibility
visibility --density 0.5
visibility --density 0.5 --samples 50
visibility --density 50 --samples 50 --dhat 1
visibility --density 0.5 --samples 0 --dhat 1
visibility --density 0.5 --samples 50 --dhat -1
visibility --density 0.5 --samples 50 --dhat nan
visibility --density 0.5 --grid 7 --dhat 1
visibility --density 0.5 --grid 7x0 --dhat 1
visibility --density 0.5 --grid 7x8 --samples 56 --dhat 1
visibility --density 0.5 --slice-density 0.1 --samples 50 --dhat 1
visibility --slice-density 0.1 --samples 50 --dhat 1
visibility --density 0.5 --height-ratio 9 --samples 50 --dhat 1
visibility --density 0.5 --positions missing.csv --spacing 1
visibility --density 0.5 --positions missing.csv
visibility --density 0.5 --samples 9 --dhat 1 --heading 30
visibility --density 0.5 --samples 50 --dhat 1 --spacing 1
scene
scene nope
scene missing.toml
scene paper-forest --save x.txt
scene paper-forest --save nofolder/x.toml
scene paper-forest --voxel 1
export
export missing.json
export missing.json --out a.csv
schema plane
cameras extra
""".strip().splitlines()


@pytest.mark.parametrize("line", BAD)
def test_a_wrong_command_line_gives_one_error_and_no_files(folder, command, line):
    check_refusal(*command(*shlex.split(line)))
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize(
    ("line", "value", "place"),
    [
        ("plan --altitude forty", "forty", "--altitude"),
        ("plan --altitude 40 --vhat 98", "98", "--vhat"),
        ("plan --altitude 40 --scene paper-forrest", "paper-forrest", "scene"),
        ("plan --altitude 40 --origin 120,14", "120,14", "--origin"),
        ("plan --altitude 15", "15", "altitude"),
        ("plan --altitude 40 --samples 49", "49", "--samples"),
        ("plan --altitude 40 --max-aperture 5", "5", "--max-aperture"),
        ("plan --altitude 40 --out plan.txt", "plan.txt", "output"),
        ("visibility --density 50 --samples 50 --dhat 1", "50", "--density"),
    ],
)
def test_errors_name_the_wrong_value_and_its_place(command, line, value, place):
    _, _, err = command(*shlex.split(line))
    error = err.splitlines()[0]
    assert value in error
    assert place in error


@pytest.mark.parametrize(
    ("line", "hint"),
    [
        ("plan --altitude 40 --vhat 98", "98%"),
        ("plan --altitude 131s", "give a number of metres"),
        ("plan --altitude 40 --scene paper-forrest", "did you mean paper-forest?"),
        ("plan --altitude 40 --camera dji-m3t-termal", "did you mean dji-m3t-thermal?"),
        ("plan --altitude 40 --model layerd", "did you mean layered?"),
        ("plan --altitude 40 --out g.geojson", "--origin LAT,LON"),
        ("plna", "plan"),
        ("plan --altitude 15", "20.04"),
        ("plan --altitude 40 --max-aperture 5", "--max-aperture"),
        ("plan --altitude 40 --samples 49", "50"),
        ("plan --altitude 40 --visibility 0.68", "0.6785"),
    ],
)
def test_errors_with_a_remedy_have_a_hint(command, line, hint):
    _, _, err = command(*shlex.split(line))
    assert hint in err.splitlines()[1].removeprefix("hint: ")


@pytest.mark.parametrize(
    ("line", "keep"),
    [
        ("plan --altitude 40 --max-aperture 5", []),
        ("plan --altitude 40 --max-aperture 5 --max-samples 60", ["--max-samples", "60"]),
        ("plan --altitude 40 --max-aperture 5 --grid square", ["--grid", "square"]),
        ("plan --altitude 40 --max-aperture 5 --model layered", ["--model", "layered"]),
    ],
)
def test_the_aperture_that_a_hint_names_is_enough(command, line, keep):
    _, _, err = command(*shlex.split(line))
    aperture = re.search(r"--max-aperture ([0-9.e+]+) is enough", err.splitlines()[1])[1]
    status, _, err = command("plan", "--altitude", "40", "--max-aperture", aperture, *keep)
    assert status == 0, err


def test_the_samples_that_a_hint_names_are_enough(command):
    line = "plan --altitude 40 --max-aperture 5 --max-samples 20"
    _, _, err = command(*shlex.split(line))
    allowed = re.search(r"give --max-samples (\d+), or", err.splitlines()[1])
    if allowed:
        line = f"plan --altitude 40 --max-aperture 5 --max-samples {allowed[1]}"
        status, _, err = command(*shlex.split(line))
        assert status == 0, err


def test_hints_never_suggest_more_samples_than_a_plan_may_have(command):
    _, _, err = command("plan", "--altitude", "40", "--vhat", "0.9999999")
    assert "is enough, with 10000000 samples" not in err


@pytest.mark.parametrize(
    "line",
    [
        "plan --altitude 1e308",
        "plan --altitude 1e160",
        "plan --gsd 1e300",
        "plan --target-size 1e300 --target-pixels 1e-300",
        "plan --altitude 1e308 --focal-height 1e308",
        "plan --altitude 40 --focal-height 1e308",
        "plan --altitude 40 --speed 1e300",
        "plan --altitude 40 --speed 1e200 --optimize time",
        "plan --altitude 40 --speed 1e-300",
        "plan --altitude 40 --acceleration 1e-300",
        "plan --altitude 40 --hold 1e308",
        "plan --altitude 40 --hold 1e308 --optimize time",
        "plan --altitude 40 --baseline 1e308 --samples 4",
        "plan --altitude 40 --baseline 1e-320 --samples 4",
        "plan --altitude 40 --baseline 1e-320",
        "plan --altitude 40 --max-aperture 1e-300",
        "plan --altitude 40 --max-aperture 1e300",
        "plan --altitude 40 --coverage 1e-300",
        "plan --altitude 40 --heading 1e300",
        "plan --altitude 40 --grid lanes --lanes 9007199254740992",
        "plan --altitude 40 --grid lanes --lane-pitch 1e300",
        "plan --altitude 40 --grid lanes --lane-pitch 1e308",
        "plan --altitude 40 --fov 1e-300 --image-width 1 --image-height 1",
        "plan --altitude 40 --fov 179.9999999999 --image-width 1 --image-height 1",
        "plan --altitude 40 --fov 60 --image-width 9007199254740992 --image-height 1",
        "plan --altitude 40 --focal-length 1e-300 --sensor-width 1e300 --image-width 1"
        " --image-height 1",
        "plan --altitude 40 --focal-length 1e300 --sensor-width 1e-300 --image-width 1"
        " --image-height 1",
        "plan --altitude 40 --density 0.5 --occluder-size 1e-300 --volume-height 10",
        "plan --altitude 40 --density 0.1 --occluder-size 1e300 --volume-height 10",
        "plan --altitude 40 --density 1e-320 --occluder-size 1 --volume-height 10",
        "plan --altitude 40 --density 0.1 --occluder-size 1 --volume-height 1e-300",
        "plan --altitude 40 --integrated-density 0.9999999999999999 --occluder-size 1"
        " --volume-height 9",
        "visibility --density 0.5 --samples 50 --dhat 1e-320",
        "visibility --density 0.5 --samples 50 --dhat 1e308",
        "visibility --density 1e-320 --samples 50 --dhat 1",
        "visibility --density 0.5 --grid 9007199254740992x9007199254740992 --dhat 1e-9",
        "visibility --slice-density 0.5 --height-ratio 1e308 --samples 9 --dhat 1",
        "visibility --slice-density 1 --height-ratio 0 --samples 9 --dhat 1",
    ],
)
@pytest.mark.parametrize("output", [["--json"], []], ids=["json", "table"])
def test_extreme_numbers_cause_no_traceback(command, line, output):
    # An unexpected exception fails the test.
    status, out, err = command(*shlex.split(line), *output)
    if status != 0:
        check_refusal(status, out, err)
    elif output:
        loads(out)
    else:
        assert "nan" not in out.lower()
        assert not re.search(r"\binf\b", out)


# Each of these commands once did not end. They need at most a few seconds on a slow computer.
ENDLESS = """
plan --altitude 40 --visibility 0.678511
plan --altitude 40 --visibility 0.6785109999999
plan --altitude 40 --vhat 0.99999999999999999999999999
plan --altitude 40 --density 1e-9 --occluder-size 1e-9 --volume-height 10 --model layered
scene s.toml
""".strip().splitlines()

BOUNDED = (
    "import resource, sys\n"
    "resource.setrlimit(resource.RLIMIT_AS, (2 * 2**30, 2 * 2**30))\n"
    "from aosplan.cli.app import main\n"
    "main(sys.argv[1:])\n"
)


@pytest.mark.parametrize("line", ENDLESS)
def test_requests_beyond_any_plan_are_refused_in_finite_time(folder, line):
    (folder / "s.toml").write_text(
        'name = "fine"\ndensity = 1e-9\noccluder_size_m = 1e-9\n'
        "volume_base_m = 2.0\nvolume_height_m = 10.0\n"
    )
    try:
        done = subprocess.run(
            [sys.executable, "-c", BOUNDED, *shlex.split(line)],
            capture_output=True,
            check=False,
            text=True,
            timeout=10,
        )
    except subprocess.TimeoutExpired:
        pytest.fail("ran without end")
    check_refusal(done.returncode, done.stdout, done.stderr)


# Names from input

NASTY = [
    "a\nb",
    "a\rb",
    "a\x1b[31mb",
    "a\u2028b",
    "a\u202eb",
    "a\x85b",
    "\x07",
    "a\tb",
    "wäld",
    "\udcff",
]


@pytest.mark.parametrize("name", NASTY, ids=ascii)
@pytest.mark.parametrize(
    "arguments",
    [
        ["plan", "--altitude", "40", "--scene", "{}"],
        ["plan", "--altitude", "40", "--scene", "{}.toml"],
        ["plan", "--altitude", "40", "--camera", "{}"],
        ["plan", "--altitude", "{}"],
        ["plan", "--altitude", "40", "--vhat", "{}"],
        ["plan", "--altitude", "40", "--grid", "{}"],
        ["plan", "--altitude", "40", "--origin", "{}"],
        ["plan", "--altitude", "40", "--out", "{}/a.csv"],
        ["plan", "--altitude", "40", "--out", "a.{}"],
        ["plan", "--altitude", "40", "--out", "a.txt", "--format", "{}"],
        ["plan", "{}.toml"],
        ["plan", "--{}"],
        ["{}"],
        ["schema", "{}"],
        ["visibility", "--density", "0.5", "--dhat", "1", "--grid", "{}"],
        ["visibility", "--density", "0.5", "--spacing", "1", "--positions", "{}"],
    ],
    ids=" ".join,
)
def test_unusual_file_names_leave_errors_on_one_line(command, arguments, name):
    check_refusal(*command(*(argument.format(name) for argument in arguments)))


def test_names_in_files_write_no_escape_sequences_to_the_terminal(folder, command):
    (folder / "s.toml").write_text(
        'name = "x\\ny"\ntitle = "\\u001b[31mred\\u001b]0;owned\\u0007"\ndensity = 0.01\n'
        "occluder_size_m = 0.2\nvolume_base_m = 2\nvolume_height_m = 18\n"
    )
    for arguments in (["plan", "--altitude", "40", "--scene", "s.toml"], ["scene", "s.toml"]):
        status, out, err = command(*arguments)
        assert (status, err) == (0, "")
        assert all(line.isprintable() for line in out.split("\n"))


def test_warnings_with_text_from_files_are_one_line(folder, command):
    (folder / "s.toml").write_text(
        'name = "x\\ny"\ndensity = 0\noccluder_size_m = 0.2\nvolume_base_m = 2\n'
        "volume_height_m = 18\n"
    )
    _, _, err = command("plan", "--altitude", "40", "--scene", "s.toml", "--json")
    assert [line.partition(": ")[0] for line in err.splitlines()] == ["warning"]


@pytest.mark.parametrize("flag", ["--scene", "--camera", "--vhat", "--out", "--area", "--drone"])
def test_very_long_names_are_shortened_in_messages(command, flag):
    refused = command("plan", "--altitude", "40", flag, "y" * 100_000)
    check_refusal(*refused, expected=refused[0])
    assert re.search(r"yyy(…|\.\.\.)", refused[2])
