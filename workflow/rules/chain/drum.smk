# The representative solution in a drum that turns until its bed slips: one job a seed, then the measurement, tables and
# a film.
DRUM_SEEDS = draw_run_seeds(
    config["design"]["seed"], "drum", int(REPRESENTATIVE), config["drum"]["seeds"]
)


wildcard_constraints:
    seed=r"\d+",


rule drum_run:
    input:
        **READY,
        samples=rules.solutions.output.solutions,
    output:
        result=f"{RESULTS}/drum/drum_{{seed}}.json",
        frames=f"{RESULTS}/drum/drum_{{seed}}.npz",
    log:
        f"{RESULTS}/logs/drum/{{seed}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/drum/{{seed}}.tsv"
    priority: 1
    retries: 1
    resources:
        **resources_for_attempt(400, minutes=MINUTES_OF_RUNS),
    params:
        config=CONFIG,
        folder=find_output_folder,
        sample=int(REPRESENTATIVE),
        settings=select_stage_settings("drum"),
        code=engine_hash(),
    message:
        "Turning the drum, seed {wildcards.seed}"
    shell:
        "python -m repose stage drum --config {params.config:q} --samples {input.samples:q} --sample {params.sample:q}"
        " --seed {wildcards.seed:q} --berry {input.berry:q} --particle {input.particle:q}"
        " --out {params.folder:q} > {log:q} 2>&1"


rule drum:
    input:
        **GRAIN,
        runs=expand(rules.drum_run.output.result, seed=DRUM_SEEDS),
        frames=expand(rules.drum_run.output.frames, seed=DRUM_SEEDS),
    output:
        runs=f"{RESULTS}/drum/runs.csv",
        summary=f"{RESULTS}/drum/summary.csv",
        record=f"{RESULTS}/drum/record.csv",
        profile=f"{RESULTS}/drum/profile.csv",
        median=f"{RESULTS}/drum/median.npz",
    log:
        f"{RESULTS}/logs/drum.log",
    benchmark:
        f"{RESULTS}/benchmarks/drum.tsv"
    resources:
        **resources_for_attempt(350),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=select_stage_settings("drum_tables"),
        code=code_hash("stages.drum_tables"),
    message:
        "Measuring the drum's runs: tables of angles, first slip, slipping layer; and choosing the median run"
    shell:
        "python -m repose stage drum_tables {input.runs:q} --config {params.config:q} --berry {input.berry:q}"
        " --particle {input.particle:q} --out {params.folder:q} > {log:q} 2>&1"


rule drum_film:
    input:
        frames=rules.drum.output.median,
        particle=rules.shape.output.particle,
    output:
        f"{RESULTS}/drum/drum.gif",
    log:
        f"{RESULTS}/logs/drum_film.log",
    benchmark:
        f"{RESULTS}/benchmarks/drum_film.tsv"
    resources:
        **resources_for_attempt(450, minutes=20),
    params:
        config=CONFIG,
        code=code_hash("report.renderer.film"),
        settings=select_sections("drum", "colour", "small_run"),
    message:
        "Film of the drum"
    shell:
        "python -m repose film {input.frames:q} --drum --config {params.config:q} --particle {input.particle:q}"
        " --out {output:q} > {log:q} 2>&1"
