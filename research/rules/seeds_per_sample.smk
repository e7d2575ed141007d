# How many pours each sample gets, on request: `snakemake -s research/Snakefile --cores 2 seeds_per_sample`. See docs/comparison.md.
# Its tables of pours and fits are no outputs, which snakemake removes when a job ends early: each step goes on with its own.
rule seeds_per_sample:
    input:
        design=rules.design.output.samples,
        ready=ancient(rules.warm_up.output.ready),
    output:
        verdict=f"{RESULTS}/seeds_per_sample/verdict.csv",
        summary=f"{RESULTS}/seeds_per_sample/verdict.json",
    log:
        f"{RESULTS}/logs/seeds_per_sample.log",
    benchmark:
        f"{RESULTS}/benchmarks/seeds_per_sample.tsv"
    threads: 16
    resources:
        mem_mb=grow_with_attempts(8000),
        runtime=grow_with_attempts(600),
    params:
        config=CONFIG,
        folder=find_output_folder,
        settings=dependencies.select_simulation_settings(config)
        | select_study_sections("berry", "parameters", "measure", "targets", "pool")
        | select_study_sections("surrogate", "network", "miga")
        | {"engine": engine_hash()},
        # pours of a sample, data sets, pours of a fresh point and of an answer
        few=lambda wildcards: (
            [13, 8, 2, 2] if config["small_run"] else [16, 64, 16, 6]
        ),
    message:
        "Choosing the seeds of a sample"
    shell:
        '(set -e; step() {{ python -m research.answers.seeds_per_sample "$@" --config {params.config:q}; }};'
        " at={params.folder:q};"
        " step pour_pool --design {input.design:q} --pool-seeds {params.few[0]:q} --processes {threads:q} --out $at/pool.csv;"
        " step pour_fresh --fresh-seeds {params.few[2]:q} --processes {threads:q} --out $at/fresh.csv;"
        " step answers --design {input.design:q} --pool $at/pool.csv --pool-seeds {params.few[0]:q}"
        " --data-sets {params.few[1]:q} --processes {threads:q} --out $at/answers.csv;"
        " step pour_answers --answers $at/answers.csv --answer-seeds {params.few[3]:q} --processes {threads:q}"
        " --out $at/answer_pours.csv;"
        " step judge --answers $at/answers.csv --fresh $at/fresh.csv --answer-pours $at/answer_pours.csv --out $at)"
        " > {log:q} 2>&1"
