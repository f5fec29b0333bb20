"""Requests with random values: the result is a request or an error of one line.  The document of a
request gives the same request again.
"""

import json

from hypothesis import example, given
from hypothesis import strategies as st

from aosplan.errors import RequestError
from aosplan.planning.request import BY_NAME, PlanRequest, request_from


def outcome(make, *arguments, **values):
    """The result, or an error of aosplan.  Any other exception is raised."""
    try:
        return make(*arguments, **values)
    except RequestError as error:
        return error


values = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=30),
    st.sampled_from(["98%", "98", "0.98", "40ft", "1e400", "_", "lanes", "line", "layered", "0"]),
    st.lists(st.floats(), max_size=3),
    st.dictionaries(st.text(max_size=3), st.integers(), max_size=2),
)

sensible = {
    "altitude": st.floats(0.1, 500),
    "gsd": st.floats(0.001, 1),
    "target_size": st.floats(0.1, 10),
    "target_pixels": st.floats(1, 100),
    "focal_height": st.floats(0, 50),
    "vhat": st.one_of(st.floats(0, 0.9999), st.sampled_from(["98%", "0.9999999999999999999"])),
    "visibility": st.floats(0, 0.9999),
    "scene": st.sampled_from(["paper-forest", "savanna", "x.toml"]),
    "density": st.floats(0, 1),
    "integrated_density": st.floats(0, 1),
    "occluder_size": st.floats(0.01, 5),
    "volume_height": st.floats(0.1, 50),
    "volume_base": st.floats(0, 10),
    "camera": st.just("dji-m3t-thermal"),
    "fov": st.floats(1, 179),
    "image_width": st.integers(1, 9000),
    "image_height": st.integers(1, 9000),
    "grid": st.sampled_from(["trimmed", "lanes", "line"]),
    "lanes": st.integers(1, 9),
    "samples": st.integers(1, 100),
    "max_samples": st.integers(1, 100),
    "origin": st.tuples(st.floats(-90, 90), st.floats(-180, 180)),
    "heading": st.floats(-720, 720),
}

junk = st.dictionaries(st.sampled_from(list(BY_NAME)), values, max_size=6)


def check_error(error):
    assert error.message
    assert error.message.isprintable()
    assert error.hint.isprintable()


@given(values=junk)
def test_any_values_make_a_request_or_one_line(values):
    result = outcome(PlanRequest, **({"altitude": 40} | values))
    if isinstance(result, RequestError):
        check_error(result)
    else:
        json.dumps(result.document(), allow_nan=False)


@given(values=junk, names=st.dictionaries(st.text(max_size=12), values, max_size=2))
@example(values={}, names={"a\nb": 1})
def test_any_table_makes_a_request_or_an_error(values, names):
    result = outcome(request_from, values | names, where="r.toml")
    assert isinstance(result, (RequestError, PlanRequest))


@given(values=st.fixed_dictionaries({}, optional=sensible))
def test_the_document_of_a_request_makes_the_same_request(values):
    result = outcome(PlanRequest, **values)
    if isinstance(result, RequestError):
        check_error(result)
        return
    document = json.loads(json.dumps(result.document(), allow_nan=False))
    assert request_from(document) == result


@given(values=st.fixed_dictionaries({}, optional=sensible))
def test_a_request_is_the_same_from_flags_and_from_a_file(values):
    flags = {
        name: ",".join(map(repr, value)) if isinstance(value, tuple) else str(value)
        for name, value in values.items()
    }
    file = outcome(request_from, values)
    typed = outcome(request_from, {}, overrides=flags)
    if isinstance(file, RequestError):
        assert isinstance(typed, RequestError)
    else:
        assert typed == file
