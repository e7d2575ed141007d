# From measured berry sizes to calibrated contact parameters: `snakemake --cores 2`.
container: "docker://python:3.11-slim"


include: "workflow/rules/common.smk"


# The default, --configfile and --config over it, checked; a bad value ends here with one message.
config = checked_config(workflow, "config/config.yaml")
RESULTS = config["results_dir"]
CONFIG = f"{RESULTS}/config.json"


# Every verb reads the checked configuration from this file; a dry run writes nothing.
onstart:
    loader.write_resolved(config, CONFIG)


include: "workflow/rules/berry.smk"
include: "workflow/rules/shape.smk"
include: "workflow/rules/design.smk"
include: "workflow/rules/heap.smk"
include: "workflow/rules/dataset.smk"
include: "workflow/rules/network.smk"
include: "workflow/rules/miga.smk"
include: "workflow/rules/validate.smk"
include: "workflow/rules/measure.smk"
include: "workflow/rules/drum.smk"
include: "workflow/rules/shape_study.smk"
include: "workflow/rules/uncertainty.smk"
include: "workflow/rules/compare_search.smk"
include: "workflow/rules/responses.smk"
include: "workflow/rules/refine_rounds.smk"
include: "workflow/rules/refine.smk"
include: "workflow/rules/pool.smk"
include: "workflow/rules/compare.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/snapshot.smk"


rule all:
    default_target: True
    input:
        rules.calibration.input,
        rules.figures.input,
        rules.tables.input,
