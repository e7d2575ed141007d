rule shape:
    input:
        berry=rules.berry.output.berry,
        stl=config["berry"]["stl"] or [],
    output:
        stl=f"{RESULTS}/berry/berry.stl",
        particle=f"{RESULTS}/berry/particle.json",
        comparison=f"{RESULTS}/berry/particles.csv",
    log:
        f"{RESULTS}/logs/shape.log",
    benchmark:
        f"{RESULTS}/benchmarks/shape.tsv"
    threads: 1
    resources:
        mem_mb=growing(550),
        runtime=growing(10),
    params:
        config=CONFIG,
        folder=folder,
        depends=stands_on.settings_of(config, "shape"),
    message:
        "Mesh and particle of the berry"
    shell:
        "python -m repose stage shape --config {params.config:q} --berry {input.berry:q} --out {params.folder:q}"
        " > {log:q} 2>&1"
