"""Number the streams of random numbers of the studies here, beyond those of `repose.calibrate.seeds.PURPOSE_STREAMS`."""

from repose.calibrate.seeds import PURPOSE_STREAMS

STREAMS = {
    "shape_published": 3,
    "shape_sensitivity": 4,
    "shape_design": 5,
    "pool": 6,
    "fresh": 7,
    "shape_fresh": 10,
    "shape_bulk": 11,
    "joint_targets": 14,
}

if set(STREAMS.values()) & set(PURPOSE_STREAMS.values()):
    raise ValueError(
        "a stream of research is one of the package; expected numbers that no other purpose has"
    )
