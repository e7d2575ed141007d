# Only on request, `snakemake -s research/Snakefile --cores 2 measurement_study`: the definitions of the angle compared on this study's piles.
PUBLISHED_REPRESENTATIVE = dict(zip(PUBLISHED_NAMES, PUBLISHED_SOLUTIONS)).get(
    "representative", PUBLISHED_SOLUTIONS[-1]
)
# The rule that chooses a line judges by the measured pair of angle and Height.
LINE_CHOICE = (
    ("choice", "verdicts")
    if {"aor_deg", "height_mm"} <= set(STUDY.targets.responses)
    else ()
)


rule measurement_study:
    input:
        heaps=expand(rules.pour.output.berries, runs="heaps", sample=SAMPLES),
        pours=expand(rules.pour.output.pours, runs="heaps", sample=SAMPLES),
        # the published representative solution; or else the last of the published sets
        representative=f"{RESULTS}/validation/heaps/{PUBLISHED_REPRESENTATIVE}.npz",
        its_pours=f"{RESULTS}/validation/heaps/{PUBLISHED_REPRESENTATIVE}.pours.json",
        berry=rules.berry.output.berry,
        particle=rules.shape.output.particle,
    output:
        **{name: f"{RESULTS}/measurement_study/{name}.csv" for name in LINE_CHOICE},
        piles=f"{RESULTS}/measurement_study/piles.csv",
        noise=f"{RESULTS}/measurement_study/noise.csv",
        correlation=f"{RESULTS}/measurement_study/correlation.csv",
        pour_correlation=f"{RESULTS}/measurement_study/pour_correlation.csv",
        bias=f"{RESULTS}/measurement_study/bias.csv",
        loose_grain=f"{RESULTS}/measurement_study/loose_grain.csv",
    log:
        f"{RESULTS}/logs/measurement_study.log",
    benchmark:
        f"{RESULTS}/benchmarks/measurement_study.tsv"
    threads: 1
    resources:
        mem_mb=grow_with_attempts(350),
        runtime=grow_with_attempts(60),
    params:
        config=CONFIG,
        folder=find_output_folder,
        piles=lambda wildcards, input: input.heaps[:8],
        depends=select_study_sections("measure", "targets"),
    message:
        "Comparing the definitions of the angle of repose"
    shell:
        "(python -m research.measurement lines {input.heaps:q} --representative {input.representative:q}"
        " --config {params.config:q} --berry {input.berry:q} --particle {input.particle:q} --out {params.folder:q};"
        " python -m research.measurement loose_grain {params.piles:q} --config {params.config:q} --berry {input.berry:q}"
        " --particle {input.particle:q} --out {output.loose_grain:q}) > {log:q} 2>&1"
