# Particle, tension, filling and definition of the angle beside the published piles. A target of its own:
# `snakemake -s research/Snakefile --cores 2 shape_study`. The selection is a checkpoint: it determines the cells that are poured again with fresh seeds.
import pandas

from research.shape import shape_cells

SHAPE = f"{RESULTS}/shape"


def first_cells(wildcards):
    """Pours of the selection; the study's own keys are checked here, when someone asks for the study."""
    with exit_on_fault():
        shape_cells.check(STUDIES)
    return expand(rules.shape_cell.output.runs, cell=shape_cells.first_cells(STUDIES))


def second_cells(wildcards):
    """Pours with fresh seeds, known when the finalists are."""
    finalists = pandas.read_csv(
        checkpoints.shape_selection.get().output.finalists, dtype=str
    )
    return expand(
        rules.shape_cell.output.runs,
        cell=shape_cells.second_cells(STUDIES, finalists),
    )


def particles_of_cells(wildcards):
    """What is kept of the particle of each cell, beside its pours."""
    runs = [*first_cells(wildcards), *second_cells(wildcards)]
    return [f"{os.path.splitext(path)[0]}.json" for path in runs]


rule shape_cell:
    input:
        samples=rules.design.output.samples,
        berry=rules.berry.output.berry,
        published=config["validation"]["published"] or [],
    output:
        runs=f"{SHAPE}/cells/{{cell}}.csv",
        particle=f"{SHAPE}/cells/{{cell}}.json",
    log:
        f"{RESULTS}/logs/shape/{{cell}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/shape/{{cell}}.tsv"
    wildcard_constraints:
        cell=r"[a-z0-9_]+(-[a-z0-9_]+){3}",
    retries: 1
    threads: 1
    resources:
        mem_mb=grow_with_attempts(600),
        runtime=grow_with_attempts(MINUTES_OF_RUNS),
    params:
        config=CONFIG,
        folder=find_output_folder,
        depends=lambda wildcards: shape_cells.dependencies(STUDIES, wildcards.cell)
        | {"engine": engine_hash()},
    message:
        "Pouring {wildcards.cell}"
    shell:
        "python -m research.shape cell --config {params.config:q} --cell {wildcards.cell:q} --berry {input.berry:q}"
        " --samples {input.samples:q} --out {params.folder:q} > {log:q} 2>&1"


checkpoint shape_selection:
    input:
        cells=first_cells,
    output:
        particles=f"{SHAPE}/particles.csv",
        piles=f"{SHAPE}/piles.csv",
        sets=f"{SHAPE}/sets.csv",
        combinations=f"{SHAPE}/combinations.csv",
        finalists=f"{SHAPE}/finalists.csv",
    log:
        f"{RESULTS}/logs/shape_selection.log",
    benchmark:
        f"{RESULTS}/benchmarks/shape_selection.tsv"
    threads: 1
    resources:
        mem_mb=grow_with_attempts(300),
        runtime=grow_with_attempts(10),
    params:
        config=CONFIG,
        folder=find_output_folder,
        depends=select_study_sections("shape_study", "targets"),
    message:
        "Selecting the finalists of the shape study"
    shell:
        "python -m research.shape selection {input.cells:q} --config {params.config:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


rule shape_tables:
    input:
        first=first_cells,
        second=second_cells,
        finalists=rules.shape_selection.output.finalists,
    output:
        fresh=f"{SHAPE}/fresh.csv",
        fresh_sets=f"{SHAPE}/fresh_sets.csv",
        noise=f"{SHAPE}/noise.csv",
        choice=f"{SHAPE}/choice.json",
    log:
        f"{RESULTS}/logs/shape_tables.log",
    benchmark:
        f"{RESULTS}/benchmarks/shape_tables.tsv"
    threads: 1
    resources:
        mem_mb=grow_with_attempts(300),
        runtime=grow_with_attempts(10),
    params:
        config=CONFIG,
        folder=find_output_folder,
        depends=select_study_sections("shape_study", "targets"),
    message:
        "Judging the finalists of the shape study"
    shell:
        "python -m research.shape verdict {input.first:q} {input.second:q} --finalists {input.finalists:q}"
        " --config {params.config:q} --out {params.folder:q} > {log:q} 2>&1"


rule draw_shape_study:
    input:
        combinations=rules.shape_selection.output.combinations,
        sets=rules.shape_selection.output.sets,
    output:
        report(
            f"{SHAPE}/shape_study.png",
            caption="../report/shape_study.rst",
            category="Particles",
            labels={"figure": "Particles, tensions, fillings and definitions"},
        ),
        list_other_formats(f"{SHAPE}/shape_study.png"),
    log:
        f"{RESULTS}/logs/figures/shape_study.log",
    benchmark:
        f"{RESULTS}/benchmarks/figures/shape_study.tsv"
    threads: 1
    resources:
        mem_mb=grow_with_attempts(400),
        runtime=grow_with_attempts(10),
    params:
        config=CONFIG,
        depends=select_study_sections("shape_study", "targets") | RESOLUTION,
    message:
        "Drawing the shape study"
    shell:
        "python -m research.figures draw shape_study --config {params.config:q} --out {output[0]:q}"
        " --input combinations={input.combinations:q} --input sets={input.sets:q} > {log:q} 2>&1"


# Every file by name, as in the method's chain: a lost file is made again.
rule shape_study:
    input:
        first_cells,
        second_cells,
        particles_of_cells,
        rules.shape_selection.output,
        rules.shape_tables.output,
        rules.draw_shape_study.output,
