"""The configuration of the made-up inputs."""

from shared import TARGETS

from repose.core.parameters import PARAMETERS

RANGES = dict(
    zip(PARAMETERS, ([0.1, 0.4], [0.35, 0.75], [0.02, 0.07], [0.2, 0.5], [0.4, 0.8], [0.1, 0.3]), strict=True)
)
CONFIG = {
    "berry": {"spheres": 14, "surface": "smooth"},
    "small_run": False,
    "colour": "#c2200b",
    "parameters": RANGES,
    "design": {"method": "optimal"},
    "funnel": {
        "inlet_diameter_mm": 150.0,
        "outlet_diameter_mm": 32.0,
        "cone_angle_deg": 60.0,
        "tube_length_mm": 0.0,
        "rim_radius_mm": 1.0,
        "outlet_height_mm": 100.0,
        "plate_diameter_mm": 600.0,
        "factory_height_mm": 12.0,
        "factory_diameter_mm": 150.0,
    },
    "measure": {
        "views": 2,
        "mm_per_pixel": 0.5,
        "response": "flank",
        "fit_from": 0.1,
        "fit_to": 0.8,
        "berry_height_mm": None,
        "largest_pile_only": True,
        "flank": "columns",
    },
    "drum": {
        "outer_diameter_mm": 300.0,
        "wall_thickness_mm": 5.0,
        "length_mm": 340.0,
        "angular_velocity_rad_s": 0.0873,
        "report_s": 10.0,
        "fit_share": 0.6,
    },
    "lifted_cylinder": {
        "diameter_mm": 100.0,
        "length_mm": 160.0,
        "rim_radius_mm": 1.0,
        "lifting_mm_s": 20.0,
        "plate_diameter_mm": 600.0,
    },
    "inclined_plane": {"surface": "wall", "tilting_deg_s": 1.0, "steepest_deg": 60.0},
    "drop_test": {"surface": "wall", "height_mm": 200.0},
    "drawdown": {
        "width_mm": 260.0,
        "depth_mm": 100.0,
        "height_mm": 200.0,
        "slot_mm": 100.0,
        "floor_mm": 4.0,
        "lower_width_mm": 500.0,
        "drop_mm": 150.0,
    },
    "refine": {"tolerance_percent": 1.0, "standard_error_percent": 0.7},
    "targets": TARGETS,
}
