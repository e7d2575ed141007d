# Is the search worth it? `snakemake -s research/Snakefile --cores 2 compare_search compare_whole`.
WHOLE_DATA = [RESULTS, *STUDIES["compare_whole"]["more_data"]]


rule search_tables:
    input:
        network=rules.network.output.network,
    output:
        curves=f"{RESULTS}/comparison/search.csv",
        methods=f"{RESULTS}/comparison/search_methods.csv",
        runs=f"{RESULTS}/comparison/search_runs.csv",
    log:
        f"{RESULTS}/logs/search_tables.log",
    benchmark:
        f"{RESULTS}/benchmarks/search_tables.tsv"
    threads: 1
    resources:
        mem_mb=grow_with_attempts(1500),
        runtime=grow_with_attempts(240),
    params:
        config=CONFIG,
        folder=find_output_folder,
        depends=select_study_sections("parameters", "targets", "miga", "compare_search"),
    message:
        "Searches beside each other on the network"
    shell:
        "python -m research.comparison search --config {params.config:q} --network {input.network:q}"
        " --out {params.folder:q} > {log:q} 2>&1"


rule whole_tables:
    input:
        datasets=expand("{data}/dataset.csv", data=WHOLE_DATA),
        runs=expand("{data}/runs.csv", data=WHOLE_DATA),
    output:
        whole=f"{RESULTS}/comparison/whole.csv",
        proposals=f"{RESULTS}/comparison/whole_proposals.csv",
    log:
        f"{RESULTS}/logs/whole_tables.log",
    benchmark:
        f"{RESULTS}/benchmarks/whole_tables.tsv"
    threads: 1
    resources:
        mem_mb=grow_with_attempts(250),
        runtime=grow_with_attempts(240),
    params:
        config=CONFIG,
        folder=find_output_folder,
        depends=select_study_sections(
            "parameters", "targets", "network", "surrogate", "miga", "compare_whole"
        ),
    message:
        "The method beside a response surface, for equal numbers of simulations"
    shell:
        "python -m research.comparison whole --config {params.config:q} --dataset {input.datasets:q} --runs {input.runs:q}"
        " --out {params.folder:q} > {log:q} 2>&1"


# Inputs of each figure.
INVERSION_FIGURES = {
    "search": {
        "curves": rules.search_tables.output.curves,
        "methods": rules.search_tables.output.methods,
    },
    "whole": {"whole": rules.whole_tables.output.whole},
}


for figure, shown in INVERSION_FIGURES.items():

    rule:
        name:
            f"draw_{figure}"
        input:
            **shown,
        output:
            report(
                f"{RESULTS}/comparison/{figure}.png",
                caption=f"../report/{figure}.rst",
                category="Comparisons",
                labels={"figure": figure},
            ),
            list_other_formats(f"{RESULTS}/comparison/{figure}.png"),
        log:
            f"{RESULTS}/logs/figures/{figure}.log",
        benchmark:
            f"{RESULTS}/benchmarks/figures/{figure}.tsv"
        threads: 1
        resources:
            mem_mb=grow_with_attempts(400),
            runtime=grow_with_attempts(10),
        params:
            config=CONFIG,
            figure=figure,
            inputs=[f"--input={key}={path}" for key, path in shown.items()],
            depends=select_study_sections("small_run", "compare_search") | RESOLUTION,
        message:
            "Drawing {params.figure}"
        shell:
            "python -m research.figures draw {params.figure:q} --config {params.config:q} {params.inputs:q} --out {output[0]:q}"
            " > {log:q} 2>&1"


rule compare_search:
    input:
        rules.search_tables.output,
        rules.draw_search.output,


rule compare_whole:
    input:
        rules.whole_tables.output,
        rules.draw_whole.output,
