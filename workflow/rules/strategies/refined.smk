# The loop closed: `snakemake --cores 2 refined`. Each round pours its proposal, judges it and, as long as it misses
# a target, refits the surrogate and searches again; a round is a checkpoint, so the next one is planned when it is done.
rule refine_data:
    input:
        dataset=rules.dataset.output.dataset,
        runs=rules.dataset.output.runs,
        rounds=lambda wildcards: expand(
            "{folder}/{name}.csv",
            folder=rounds_until(wildcards),
            name=("dataset", "runs"),
        ),
    output:
        dataset=f"{REFINED}/round_{{round}}/data/dataset.csv",
        runs=f"{REFINED}/round_{{round}}/data/runs.csv",
        summary=f"{REFINED}/round_{{round}}/data/dataset_summary.json",
    log:
        f"{RESULTS}/logs/refined/{{round}}_data.log",
    wildcard_constraints:
        round=r"[1-9]\d?",
    resources:
        **needs(300),
    params:
        folder=folder,
        rounds=rounds_until,
    message:
        "Adding the samples of {wildcards.round} rounds to the design's"
    shell:
        "python -m repose stage refine_data {params.rounds:q} --dataset {input.dataset:q} --runs {input.runs:q}"
        " --out {params.folder:q} > {log:q} 2>&1"


use rule network as refine_network with:
    input:
        dataset=rules.refine_data.output.dataset,
        runs=rules.refine_data.output.runs,
    output:
        network=f"{REFINED}/round_{{round}}/network/network.json",
        metrics=f"{REFINED}/round_{{round}}/network/metrics.json",
        predictions=f"{REFINED}/round_{{round}}/network/predictions.csv",
        starts=f"{REFINED}/round_{{round}}/network/starts.csv",
    log:
        f"{RESULTS}/logs/refined/{{round}}_network.log",
    wildcard_constraints:
        round=r"[1-9]\d?",
    message:
        "Refitting the surrogate for round {wildcards.round}"


rule refine_search:
    input:
        network=rules.refine_network.output.network,
        dataset=rules.refine_data.output.dataset,
        near=lambda wildcards: f"{last_round(wildcards)}/proposal.csv",
        table3=published("table3.csv"),
    output:
        network=f"{REFINED}/round_{{round}}/miga/network.json",
        feasible=f"{REFINED}/round_{{round}}/miga/feasible.csv",
        summary=f"{REFINED}/round_{{round}}/miga/summary.json",
    log:
        f"{RESULTS}/logs/refined/{{round}}_search.log",
    wildcard_constraints:
        round=r"[1-9]\d?",
    resources:
        **needs(300, minutes=30),
    params:
        **of_stage("refine_search"),
    message:
        "Searching near the last proposal for round {wildcards.round}"
    shell:
        "python -m repose stage refine_search --config {params.config:q} --network {input.network:q}"
        " --dataset {input.dataset:q} --near {input.near:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


rule refine_propose:
    input:
        unpack(searched),
    output:
        proposal=f"{REFINED}/round_{{round}}/proposal.csv",
    log:
        f"{RESULTS}/logs/refined/{{round}}_propose.log",
    wildcard_constraints:
        round=r"\d{1,2}",
    resources:
        **needs(250),
    params:
        **of_stage("refine_propose"),
    message:
        "Proposal of round {wildcards.round} and its neighbours"
    shell:
        "python -m repose stage refine_propose --config {params.config:q} --feasible {input.feasible:q}"
        " --network {input.network:q} --round {wildcards.round:q} --out {params.folder:q} > {log:q} 2>&1"


checkpoint refine_round:
    input:
        proposal=rules.refine_propose.output.proposal,
        dataset=f"{REFINED}/round_{{round}}/dataset.csv",
        runs=f"{REFINED}/round_{{round}}/runs.csv",
    output:
        verdict=f"{REFINED}/round_{{round}}/verdict.json",
        points=f"{REFINED}/round_{{round}}/round.csv",
    log:
        f"{RESULTS}/logs/refined/{{round}}_judge.log",
    wildcard_constraints:
        round=r"\d{1,2}",
    resources:
        **needs(300),
    params:
        **of_stage("refine_judge"),
    message:
        "Judging round {wildcards.round}"
    shell:
        "python -m repose stage refine_judge --config {params.config:q} --proposal {input.proposal:q}"
        " --dataset {input.dataset:q} --runs {input.runs:q} --out {params.folder:q} > {log:q} 2>&1"


rule refine_tables:
    input:
        verdicts=verdicts,
    output:
        rounds=f"{REFINED}/rounds.csv",
        summary=f"{REFINED}/summary.json",
    log:
        f"{RESULTS}/logs/refine_tables.log",
    resources:
        **needs(300),
    params:
        **of_stage("refine_tables"),
    message:
        "All rounds of the refinement"
    shell:
        "python -m repose stage refine_tables {input.verdicts:q} --config {params.config:q} --out {params.folder:q}"
        " > {log:q} 2>&1"


figure(
    "approach",
    "The loop closed",
    "targets",
    "refine.tolerance_percent",
    "refine.standard_error_percent",
    folder="refined",
    rounds=rules.refine_tables.output.rounds,
    summary=rules.refine_tables.output.summary,
)


# Every file by name, as in the method's chain: a lost file is made again.
rule refined:
    input:
        files_of_rounds,
        rules.refine_tables.output,
        all_files("approach"),
