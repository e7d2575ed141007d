"""What the bench tests give, by name."""

from repose.core.responses import Response, register
from repose.core.runs import Recorded
from repose.measure import angles

# The keys of `measure` that define what is seen of a pile.
SEEN = ("measure.views", "measure.mm_per_pixel", "measure.largest_pile_only")
DRUM = ("drum_slip_deg", "drum_rest_deg")
LINE = ("measure.flank", "measure.fit_from", "measure.fit_to", "measure.berry_height_mm")


def _funnel(name, unit, label, symbol, high, definition=(*SEEN, "measure.berry_height_mm")):
    return Response(name, unit, label, symbol, "funnel", 0.0, high, definition)


# What the tables of a study keep of the runs of each bench test.
RECORDED = {
    "funnel": angles.RECORDED,
    "drum": Recorded(means=DRUM, single=DRUM),
}

register(
    Response(
        "aor_deg", "deg", "angle of repose", "AoR", "funnel", 1.0, 89.0, (*SEEN, *LINE, "measure.response")
    ),
    Response("height_mm", "mm", "Height", "Height", "funnel", 1.0, 2000.0, SEEN),
    _funnel("aor_flank_deg", "deg", "angle, flank", "flank", 89.0, (*SEEN, *LINE)),
    _funnel("aor_secant_deg", "deg", "angle, secant", "secant", 89.0),
    _funnel("aor_steepest_deg", "deg", "angle, steepest", "steepest", 89.0, (*SEEN, *LINE)),
    _funnel("aor_whole_deg", "deg", "angle, whole side", "whole", 89.0, (*SEEN, "measure.flank")),
    _funnel("base_radius_mm", "mm", "base radius", "base radius", 10000.0),
    _funnel("lower_deg", "deg", "lower flank", "lower flank", 89.0),
    _funnel("upper_deg", "deg", "upper flank", "upper flank", 89.0),
    _funnel("packing_percent", "%", "packing", "packing", 100.0),
    _funnel(
        "radius_90_mm",
        "mm",
        "radius of 90 % of the berries",
        "radius of 90 %",
        10000.0,
        ("funnel.plate_diameter_mm",),
    ),
    _funnel("loose_percent", "%", "loose berries", "loose", 100.0, ("funnel.plate_diameter_mm",)),
    _funnel("discharge_s", "s", "discharge time", "discharge", 10000.0, ()),
    Response("drum_slip_deg", "deg", "drum, slip", "slip", "drum", 0.0, 3600.0, ("drum.slip_drop_deg",)),
    Response(
        "drum_rest_deg", "deg", "drum, after the slip", "rest", "drum", -90.0, 90.0, ("drum.slip_drop_deg",)
    ),
)
