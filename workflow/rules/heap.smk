# A pour that fails is a result with a status; only a crash ends with an error and is tried once more.
SAMPLES = [f"{number:03d}" for number in range(1, config["design"]["samples"] + 1)]


wildcard_constraints:
    sample=r"\d{3}",


rule heap:
    input:
        samples=rules.design.output.samples,
        berry=rules.berry.output.berry,
        particle=rules.shape.output.particle,
    output:
        result=f"{RESULTS}/heaps/{{sample}}.json",
        berries=f"{RESULTS}/heaps/{{sample}}.npz",
    log:
        f"{RESULTS}/logs/heaps/{{sample}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/heaps/{{sample}}.tsv"
    retries: 1
    threads: 1
    resources:
        mem_mb=600,
    params:
        config=CONFIG,
        folder=folder,
        seeds=config["heap"]["seeds"],
        depends=pouring_settings(),
    message:
        "Pouring sample {wildcards.sample}"
    shell:
        "python -m repose heap --config {params.config} --samples {input.samples} --sample {wildcards.sample}"
        " --seeds {params.seeds} --purpose design --berry {input.berry} --particle {input.particle}"
        " --out {params.folder} > {log} 2>&1"
