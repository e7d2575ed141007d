# The answer as one file, for people and for other programs.
rule card:
    input:
        berry=rules.berry.output.berry,
        particle=rules.shape.output.particle,
        feasible=rules.miga.output.feasible,
        summary=rules.miga.output.summary,
        representative=rules.validate.output.representative,
        # the posterior takes the scatter of the targets from runs of one sample
        posterior=rules.posterior_tables.output.posterior if SCATTER_IS_KNOWN else [],
        draws=rules.posterior_tables.output.draws if SCATTER_IS_KNOWN else [],
    output:
        card=f"{RESULTS}/card.json",
    log:
        f"{RESULTS}/logs/card.log",
    benchmark:
        f"{RESULTS}/benchmarks/card.tsv"
    threads: 1
    resources:
        mem_mb=growing(300),
        runtime=growing(10),
    params:
        config=CONFIG,
        posterior=lambda wildcards, input: [
            f"--{name}={path}"
            for name, path in input.items()
            if name in ("posterior", "draws") and path
        ],
        depends=stands_on.settings_of(config, "material_card")
        | {"label": config["label"]},
    message:
        "The material card: {output}"
    shell:
        "python -m repose stage material_card --config {params.config:q} --berry {input.berry:q}"
        " --particle {input.particle:q} --feasible {input.feasible:q} --summary {input.summary:q}"
        " --representative {input.representative:q} {params.posterior:q} --out {output.card:q} > {log:q} 2>&1"
