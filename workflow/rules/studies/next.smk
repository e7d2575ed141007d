# What to measure next, on request: `snakemake --cores 2 next`. Draws of the posterior in every bench test of the configuration.
NEXT = f"{RESULTS}/next"


rule plausible:
    input:
        draws=rules.posterior_tables.output.draws,
    output:
        samples=f"{NEXT}/samples.csv",
    log:
        f"{RESULTS}/logs/next/samples.log",
    benchmark:
        f"{RESULTS}/benchmarks/next/samples.tsv"
    resources:
        **resources_for_attempt(250),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("plausible"),
        code=code_hash("stages.next_measurement"),
    message:
        "Plausible parameter sets"
    shell:
        "python -m repose stage plausible --config {params.config:q} --draws {input.draws:q} --out {output.samples:q}"
        " > {log:q} 2>&1"


use rule pour as next_pour with:
    input:
        **READY,
        samples=rules.plausible.output.samples,
    output:
        pours=f"{NEXT}/{{runs}}/{{sample}}.pours.json",
        berries=f"{NEXT}/{{runs}}/{{sample}}.npz",
    log:
        f"{RESULTS}/logs/next/{{runs}}/{{sample}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/next/{{runs}}/{{sample}}.tsv"
    params:
        purpose="next",
        seeds=N_SEEDS_OF_PLAUSIBLE_SET,
        more=["--keep-runs"],
    message:
        "Plausible set {wildcards.sample}, {wildcards.runs}"


rule next:
    input:
        **GRAIN,
        pours=expand(
            rules.next_pour.output.pours,
            runs=[runs for name, runs in RUN_FOLDERS.items() if config.get(name)],
            sample=[f"{k:03d}" for k in range(1, N_PLAUSIBLE_SETS + 1)],
        ),
    output:
        table=f"{NEXT}/next.csv",
    log:
        f"{RESULTS}/logs/next/table.log",
    benchmark:
        f"{RESULTS}/benchmarks/next/table.tsv"
    resources:
        **resources_for_attempt(350, minutes=MINUTES_OF_RUNS),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("next"),
        code=code_hash("stages.next_measurement"),
    message:
        "What to measure next"
    shell:
        "python -m repose next {input.pours:q} --config {params.config:q} --berry {input.berry:q}"
        " --particle {input.particle:q} --out {params.folder:q} > {log:q} 2>&1"
