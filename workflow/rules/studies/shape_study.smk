# Particle, filling and definition of the angle beside the published piles. A target of its own:
# `snakemake --cores 2 shape_study`.
CELLS = shape_study.cells(config)


rule shape_cell:
    input:
        samples=rules.design.output.samples,
        berry=rules.berry.output.berry,
        published=config["validation"]["published"] or [],
    output:
        runs=f"{RESULTS}/shape/cells/{{cell}}.csv",
        particle=f"{RESULTS}/shape/cells/{{cell}}.json",
    log:
        f"{RESULTS}/logs/shape/{{cell}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/shape/{{cell}}.tsv"
    wildcard_constraints:
        cell=r"[a-z0-9_]+-[a-z0-9_]+-[a-z0-9_]+",
    retries: 1
    threads: 1
    resources:
        mem_mb=600,
    params:
        config=CONFIG,
        folder=folder,
        depends=lambda wildcards: shape_study.dependencies(config, wildcards.cell),
    message:
        "Pouring {wildcards.cell}"
    shell:
        "python -m repose shape_cell --config {params.config} --cell {wildcards.cell} --berry {input.berry}"
        " --samples {input.samples} --out {params.folder} > {log} 2>&1"


rule shape_tables:
    input:
        cells=cells_of_the_study,
        particles=expand(rules.shape_cell.output.particle, cell=CELLS),
    output:
        sets=f"{RESULTS}/shape/sets.csv",
        combinations=f"{RESULTS}/shape/combinations.csv",
        noise=f"{RESULTS}/shape/noise.csv",
        particles=f"{RESULTS}/shape/particles.csv",
        choice=f"{RESULTS}/shape/choice.json",
    log:
        f"{RESULTS}/logs/shape_tables.log",
    benchmark:
        f"{RESULTS}/benchmarks/shape_tables.tsv"
    threads: 1
    resources:
        mem_mb=300,
    params:
        config=CONFIG,
        folder=folder,
        depends=sections("shape_study", "targets"),
    message:
        "Particles, fillings and definitions beside the published piles"
    shell:
        "python -m repose shape_study {input.cells} --config {params.config} --out {params.folder} > {log} 2>&1"


rule draw_shape_study:
    input:
        combinations=rules.shape_tables.output.combinations,
        sets=rules.shape_tables.output.sets,
    output:
        report(
            f"{RESULTS}/shape/shape_study.png",
            caption="../../report/shape_study.rst",
            category="Particles",
            labels={"figure": "Particles, fillings and definitions"},
        ),
    log:
        f"{RESULTS}/logs/figures/shape_study.log",
    benchmark:
        f"{RESULTS}/benchmarks/figures/shape_study.tsv"
    threads: 1
    resources:
        mem_mb=500,
    params:
        config=CONFIG,
        depends=sections("shape_study", "targets"),
    message:
        "Drawing the shape study"
    shell:
        "python -m repose figure shape_study --config {params.config} --out {output}"
        " --input combinations={input.combinations} --input sets={input.sets} > {log} 2>&1"


rule shape_study:
    input:
        rules.shape_tables.output,
        rules.draw_shape_study.output,
