"""Particle, tension, filling and definition of the angle beside the published piles."""

from repose.config import dependencies
from research.script import Script, option
from research.shape import shape_cells, shape_study

OUT = "results/shape"
CELLS = option("cells", nargs="+", help="CSV files of the part cell")

script = Script("shape", __doc__)


def depends_on(config, apparatus):
    """List the settings that a cell depends on; `config` is its own, without other cells' settings."""
    found = dependencies.select_simulation_settings(
        config
    ) | dependencies.select_simulation_settings(config, "cylinder")
    found |= dependencies.select_sections(
        config, "measure", "targets"
    ) | dependencies.select_measurement_settings(config, "cylinder")
    return (
        found
        | dependencies.select_stage_settings(config, "berry")
        | dependencies.select_stage_settings(config, "published_solutions")
    )


@script.part(
    "cell",
    f"{OUT}/cells",
    option(
        "--cell",
        required=True,
        help="KIND-PARTICLE-TENSION-FILLING of the section shape_study",
    ),
    option("--berry", default="results/berry/berry.json"),
    option("--samples", default="results/design/samples.csv"),
    depends_on=depends_on,
    simulates=True,
)
def cell(args, config):
    """Pour and measure one combination of particle, tension and filling, or fill a measuring cylinder."""
    shape_cells.check(config, args.config)
    shape_study.run_cell(config, args.cell, args.berry, args.samples, args.out)


@script.part("selection", OUT, CELLS)
def selection(args, config):
    """Compare all combinations with the published piles; select finalists."""
    shape_study.run_selection(config, args.cells, args.out)


@script.part(
    "verdict",
    OUT,
    CELLS,
    option("--finalists", required=True, help="of the part selection"),
)
def verdict(args, config):
    """Judge the finalists by their fresh pours and choose one."""
    shape_study.run_verdict(config, args.cells, args.finalists, args.out)


if __name__ == "__main__":
    script.run()
