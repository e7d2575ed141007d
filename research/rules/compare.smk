# Parts of the method beside their alternatives, on request: `snakemake -s research/Snakefile --cores 2 compare`. See docs/comparison.md.
COMPARISON = f"{RESULTS}/comparison"
# Inputs of each comparison besides the pours, its tables, and its memory in MB.
COMPARISONS = {
    "accuracy": (("network", "surrogate"), (), 200),
    "surrogates": (("network", "surrogate", "pool.seed"), (), 250),
    "sampling": (
        ("network", "surrogate", "pool.seed", "parameters", "funnel.seeds"),
        ("emulator.json",),
        400,
    ),
}


for comparison, (depends, more, memory_mb) in COMPARISONS.items():

    rule:
        name:
            f"compare_{comparison}"
        input:
            main_dataset=rules.dataset.output.dataset,
            main_runs=rules.dataset.output.runs,
            pool_dataset=rules.pool_dataset.output.dataset,
            pool_runs=rules.pool_dataset.output.runs,
            fresh_dataset=rules.fresh_dataset.output.dataset,
            fresh_runs=rules.fresh_dataset.output.runs,
        output:
            f"{COMPARISON}/{comparison}.csv",
            [f"{COMPARISON}/{name}" for name in more],
        log:
            f"{RESULTS}/logs/compare_{comparison}.log",
        benchmark:
            f"{RESULTS}/benchmarks/compare_{comparison}.tsv"
        threads: 1
        resources:
            mem_mb=grow_with_attempts(memory_mb),
            runtime=grow_with_attempts(240),
        params:
            config=CONFIG,
            folder=find_output_folder,
            comparison=comparison,
            depends=select_study_sections(*depends),
        message:
            "Comparing {params.comparison}"
        shell:
            "python -m research.comparison {params.comparison:q} --config {params.config:q}"
            " --main-dataset {input.main_dataset:q} --main-runs {input.main_runs:q}"
            " --pool-dataset {input.pool_dataset:q} --pool-runs {input.pool_runs:q}"
            " --fresh-dataset {input.fresh_dataset:q} --fresh-runs {input.fresh_runs:q}"
            " --out {params.folder:q} > {log:q} 2>&1"

    rule:
        name:
            f"draw_{comparison}"
        input:
            f"{COMPARISON}/{comparison}.csv",
        output:
            report(
                f"{COMPARISON}/{comparison}.png",
                caption=f"../report/{comparison}.rst",
                category="Comparisons",
                labels={"figure": comparison.capitalize()},
            ),
            list_other_formats(f"{COMPARISON}/{comparison}.png"),
        log:
            f"{RESULTS}/logs/figures/{comparison}.log",
        benchmark:
            f"{RESULTS}/benchmarks/figures/{comparison}.tsv"
        threads: 1
        resources:
            mem_mb=grow_with_attempts(400),
            runtime=grow_with_attempts(10),
        params:
            config=CONFIG,
            figure=comparison,
            depends=select_study_sections("small_run") | RESOLUTION,
        message:
            "Drawing {params.figure}"
        shell:
            "python -m research.figures draw {params.figure:q} --config {params.config:q} --input {params.figure:q}={input:q}"
            " --out {output[0]:q} > {log:q} 2>&1"


rule compare:
    input:
        expand(f"{COMPARISON}/{{comparison}}.csv", comparison=COMPARISONS),
        [
            [png, list_other_formats(png)]
            for png in expand(f"{COMPARISON}/{{name}}.png", name=COMPARISONS)
        ],


rule comparison_table:
    input:
        sampling=f"{COMPARISON}/sampling.csv",
        surrogates=f"{COMPARISON}/surrogates.csv",
        search=rules.search_tables.output.methods,
        whole=rules.whole_tables.output.whole,
    output:
        f"{COMPARISON}/comparison.csv",
    log:
        f"{RESULTS}/logs/comparison_table.log",
    benchmark:
        f"{RESULTS}/benchmarks/comparison_table.tsv"
    threads: 1
    resources:
        mem_mb=grow_with_attempts(100),
        runtime=grow_with_attempts(10),
    params:
        folder=find_output_folder,
    message:
        "All comparisons in one table"
    shell:
        "python -m research.comparison all --sampling {input.sampling:q} --surrogates {input.surrogates:q}"
        " --search {input.search:q} --whole {input.whole:q} --out {params.folder:q} > {log:q} 2>&1"


rule compare_all:
    input:
        rules.comparison_table.output,
        rules.compare.input,
        rules.compare_search.input,
        rules.compare_whole.input,
