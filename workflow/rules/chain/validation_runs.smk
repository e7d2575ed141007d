# The solutions, simulated again by a program of the user's own.
# The representative one gets more runs.
RUNS_OF_SOLUTION = dict.fromkeys(OWN_SOLUTIONS, config["validation"]["seeds"])
RUNS_OF_SOLUTION[OWN_SOLUTIONS[0]] = config["validation"]["representative_seeds"]
SOLUTION_RUNS = results_folder.list_run_records(
    f"{RESULTS}/validation/{FOLDERS[0]}", RUNS_OF_SOLUTION
)


use rule simulate as validation_simulate with:
    input:
        samples=rules.solutions.output.solutions,
    output:
        record=f"{RESULTS}/validation/{{runs}}/{{sample}}/{{run}}.json",
    log:
        f"{RESULTS}/logs/validation/{{runs}}/{{sample}}_{{run}}.log",
    benchmark:
        f"{RESULTS}/benchmarks/validation/{{runs}}/{{sample}}_{{run}}.tsv"
    params:
        purpose="validation",
    message:
        "{PROGRAM.name}, solution {params.sample}, run {wildcards.run}: {params.command}"


use rule measure_runs as measure_validation_runs with:
    input:
        records=SOLUTION_RUNS,
        samples=rules.solutions.output.solutions,
    output:
        result=list_sample_paths(
            OWN_SOLUTIONS, f"{RESULTS}/validation/{{runs}}/{{sample}}.json"
        ),
    log:
        f"{RESULTS}/logs/validation/{{runs}}_measured.log",
    benchmark:
        f"{RESULTS}/benchmarks/validation/{{runs}}_measured.tsv"
